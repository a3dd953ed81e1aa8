"""The bonded elastic layer: surface displacement from surface traction, and an approximate inverse.

In: an ``Elastomer`` and a grid's spacing and size. Out: operators on tractions.
"""
