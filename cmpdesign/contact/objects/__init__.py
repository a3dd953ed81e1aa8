"""Rigid objects that touch the layer, from formulas, pictures or arrays.

In: dimensions in mm. Out: heights of their underside.
"""
