"""Tracking: every frame is numbered by itself; the frame before only saves time.

In: images of one size. Out: a ``Tracked`` for each, with displacements against the rest frame.
"""
