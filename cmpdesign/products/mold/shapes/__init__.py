"""Bosses, holes, dishes and crowns: what the parts of a mold are shaped by.

In: a ``Stack``. Out: features and solids.
"""
