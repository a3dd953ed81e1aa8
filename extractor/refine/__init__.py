"""Refinement: all markers are solved together, from edge profiles along the gridlines and then by synthesis.

In: the image at several scales, and the markers' first places. Out: places with covariances, and the appearance.
"""
