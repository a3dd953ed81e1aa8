"""The dimensions that all parts of a mold share: layers, levels, outlines, pins, crown, silicones. No solids.

In: a ``Design`` and its ``Layout``. Out: a ``Stack``.
"""
