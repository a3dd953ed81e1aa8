"""Tool paths: kerf compensation, corners, fill, burning order, and the cavities that the beam leaves.

In: outlines of cells in mm and a ``BeamFootprint``. Out: strokes in burning order, cavities, webs, times.
"""
