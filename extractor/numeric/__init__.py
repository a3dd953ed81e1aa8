"""Numeric tools without knowledge of patterns: sampling, triangulation, nearest points, medians, the Gaussian.

In: arrays. Out: arrays.
"""
