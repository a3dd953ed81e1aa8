"""Bosses, holes, dishes and crowns of the parts of a mold.

In: a ``MoldStack``. Out: features and solids.
"""
