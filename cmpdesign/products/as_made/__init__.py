"""Pads as made, at the side that the camera sees: their cells, and the reading of a picture of the pad.

In: a layout, and the outlines of a product's cells. Out: a ``MadePad``, its figures, the reading of its picture.
"""
