"""The layout of the pattern: ``layout.json`` read and checked, and the tables that the stages use.

In: the text of ``layout.json``. Out: a ``Reference``; from it the ``Lattice`` for numbering and the ``Topology`` for
refinement.
"""
