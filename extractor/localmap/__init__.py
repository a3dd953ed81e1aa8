"""Local maps between layout and image: polynomials of degree 1 to 3 with a prior, around one place.

In: numbered places in the layout (mm) and in the image (px). Out: maps, predicted places, and the residuals of both.
"""
