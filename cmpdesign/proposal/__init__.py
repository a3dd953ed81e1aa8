"""A design for a camera: pitch and layers by field of view and wanted error.

In: pixels, field of view, imaging conditions, wanted error. Out: a ``Proposal`` with a design and predicted figures.
"""
