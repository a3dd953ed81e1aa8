"""Frames of a plan.

In: a TOML file with designs and distributions; the number of a frame. Out: the frame's picture, truth, markers and
forces.
"""
