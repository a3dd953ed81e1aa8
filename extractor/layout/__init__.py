"""The layout that an image is compared with: ``layout.json`` read and checked, and the tables that stages need of it.

In: the text of ``layout.json``. Out: a ``Reference``; from it the ``Lattice`` for numbering and the ``Topology`` for
refinement.
"""
