"""How far every gridline lies from where it is drawn, and how far each measurement is to be trusted.

In: the image or its residual, gridlines. Out: offsets across the gridlines with weights, and how freely gridlines bend.
"""
