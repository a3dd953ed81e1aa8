"""Numeric tools without knowledge of patterns: compilation, small systems, sampling, triangulation, the Gaussian.

In: arrays. Out: arrays.
"""
