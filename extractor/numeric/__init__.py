"""Numeric tools that know nothing of patterns: compilation, small systems, sampling, triangulation, the Gaussian.

In: arrays. Out: arrays.
"""
