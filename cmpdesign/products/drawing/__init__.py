"""Drawings: ``pattern.svg``, true to size, and ``preview.png``.

In: a ``Layout``. Out: texts and pictures.
"""
