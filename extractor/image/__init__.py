"""Stages 1 and 2: from pixels to inks.

In: an image of any common kind. Out: 8-bit BGR at several scales, the target area, and the ink of every pixel.
"""
