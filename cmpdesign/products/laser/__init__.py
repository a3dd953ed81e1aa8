"""Laser jobs: tool paths of a layout, the resulting geometry of the silicone, and files of laser programs.

In: a ``Layout``, a machine, a material. Out: the folder ``laser/`` with its job sheet and coupon.
"""
