"""File formats of laser programs. A format knows no layout.

In: a drawing of passes on layers. Out: SVG, DXF, LightBurn and G-code as text.
"""
