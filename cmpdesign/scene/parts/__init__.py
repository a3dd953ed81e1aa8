"""The parts that a scene is composed of: background, light, optics, sensor, damage, surface.

In: a few parameters each. Out: frozen values that can draw or map.
"""
