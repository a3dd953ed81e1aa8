"""Presentation of figures: statistics, plots and an HTML page.

In: figures. Out: texts.
"""
