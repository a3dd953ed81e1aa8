"""Silicones, values with their sources, and what is weighed of a silicone.

In: TOML files and volumes. Out: ``Silicone``, ``Weighing``, and their lines of a process sheet.
"""
