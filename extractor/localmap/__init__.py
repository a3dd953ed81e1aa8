"""Local maps between layout and image: affine and quadratic, through the cells or markers around one place.

In: numbered places in the layout (mm) and in the image (px). Out: maps, predicted places, and the residuals of both.
"""
