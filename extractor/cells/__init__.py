"""Stages 3 to 6: from inks to cells and their mesh.

In: the ink of every pixel. Out: colored cells with their triangles, and the triangular mesh through the cells' centres.
"""
