"""Stage 7, the spin-search algorithm: from cells to numbered cells, and a first place for every marker.

In: cells and their mesh, the layout's lattice. Out: which cell of the layout every cell of the image is, or None; and
the markers' places that the cells at each marker agree upon.
"""
