"""The kerf coupon: its design, its laser job, and the kerf read from a photo of the cut piece.

In: a ``LaserSetup``, or a photo. Out: a ``LaserDrawing``, or the kerf with its deviation.
"""
