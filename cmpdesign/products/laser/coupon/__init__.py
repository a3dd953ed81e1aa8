"""The kerf coupon: its design, its laser job, and the kerf read from a photo of the cut piece.

In: a ``Setup``, or a photo. Out: a job, or the kerf with its deviation.
"""
