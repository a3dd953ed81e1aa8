"""The offsets of the gridlines from their drawn places, with weights, and the bending of the gridlines.

In: the image or its residual, gridlines. Out: offsets across the gridlines, weights, variances of the bending.
"""
