"""The parts of a scene: background, light, optics, sensor, damage, surface.

In: parameters of each part. Out: frozen values that draw planes or map points.
"""
