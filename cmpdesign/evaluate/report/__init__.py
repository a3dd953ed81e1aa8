"""How figures are shown: statistics, plots and an HTML page.

In: figures. Out: texts.
"""
