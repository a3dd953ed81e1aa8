"""The calls behind the commands, by the same names: what ``import cmpdesign`` offers.

In: names of templates, paths, images, options. Out: designs, layouts, verdicts, runs, files.
"""
