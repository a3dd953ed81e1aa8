"""The commands that make data sets: ``dataset`` and ``extract``.

In: a plan, or a layout and sources. Out: a folder of shards.
"""
