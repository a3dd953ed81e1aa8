"""Tracking: every frame is numbered independently; the previous frame only saves time.

In: images of one size. Out: a ``Tracked`` for each, with displacements against the rest frame.
"""
