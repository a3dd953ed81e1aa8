"""Rigid objects that touch the elastic layer, from formulas, pictures or arrays.

In: dimensions in mm. Out: heights of the objects' underside.
"""
