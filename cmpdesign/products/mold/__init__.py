"""Molds: parts to cast a pad in silicone layers, as STEP files and triangle meshes, with pictures and a job sheet.

In: a ``Design`` and its ``Layout``. Out: the folders ``mold/`` and ``mesh/``.
"""
