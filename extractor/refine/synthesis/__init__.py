"""The pattern drawn from the current estimate with the image's own ink levels and blur, and the drawing's residual.

In: markers, blur, ink levels. Out: curved gridlines, the coverage of every pixel, the drawn pattern, the sums of the
residual along the gridlines.
"""
