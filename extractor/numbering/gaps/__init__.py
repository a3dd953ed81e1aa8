"""Cells that stand apart, behind a scratch or amid missing cells: numbered by prediction and color, or left out.

In: numbered cells, cells without a number. Out: more numbered cells.
"""
