"""Cameras: from millimetres in the layout frame or in space to pixels.

In: parameters of a camera. Out: projections.
"""
