"""Drawings of the pattern: ``pattern.svg`` at true size, and ``preview.png``.

In: a ``Layout``. Out: SVG text and PNG bytes.
"""
