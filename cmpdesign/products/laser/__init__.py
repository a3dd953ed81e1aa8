"""Laser jobs: from a layout to tool paths, what these leave in the silicone, and the files of laser programs.

In: a ``Layout``, a machine, a material. Out: the folder ``laser/`` with its job sheet and coupon.
"""
