"""The work of ``track`` and ``reconstruct``, and their options.

In: a layout, sources, options. Out: the record of a run, its files written.
"""
