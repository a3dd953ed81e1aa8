"""The pattern drawn from its current markers with the image's own inks and blur, and the residual along gridlines.

In: markers, blur, ink levels. Out: curved gridlines, the coverage of every pixel, the drawn pattern, the residual.
"""
