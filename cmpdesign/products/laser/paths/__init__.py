"""Tool paths: kerf, corners, fill, order, and the cavities that the beam leaves.

In: outlines of cells in mm and a beam. Out: strokes in burning order, cavities, webs, times.
"""
