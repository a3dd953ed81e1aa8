"""Readers of the former square pattern, the baseline.

In: an image. Out: numbered corners.
"""
