"""Pads as they are made, at the side that the camera sees: their cells, and how they are read.

In: a layout, and the outlines of a product's cells. Out: a ``MadePad``, its figures, the reading of its picture.
"""
