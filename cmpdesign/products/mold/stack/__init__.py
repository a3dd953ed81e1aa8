"""The dimensions that all parts of a mold share: silicone layers, levels, outlines, pins, crown. No solids.

In: a ``Design`` and its ``Layout``. Out: a ``MoldStack``.
"""
