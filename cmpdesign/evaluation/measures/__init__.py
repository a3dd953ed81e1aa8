"""Measures of the experiments: single cells, edges, the pressed cube, reconstructed shapes.

In: pictures, markers or surfaces. Out: figures.
"""
