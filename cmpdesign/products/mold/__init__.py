"""Molds: parts to cast a pad in layers, as STEP and meshes, with pictures and a job sheet.

In: a ``Design`` and its ``Layout``. Out: the folders ``mold/`` and ``mesh/``.
"""
