"""File formats of laser programs. The formats do not depend on layouts.

In: a ``LaserDrawing``: passes on laser layers. Out: SVG, DXF, LightBurn and G-code as text.
"""
