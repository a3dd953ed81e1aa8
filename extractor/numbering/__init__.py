"""Stage 7, the spin-search algorithm: from cells to numbered cells, and an initial place for every marker.

In: cells and their mesh, the layout's lattice. Out: the layout's cell of every cell of the image, or None; and the
markers' places, averaged from the cells at each marker.
"""
