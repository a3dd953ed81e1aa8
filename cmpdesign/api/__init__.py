"""The calls behind the commands, by the same names: the public names of ``import cmpdesign``.

In: names of templates, paths, images, options. Out: designs, layouts, verdicts, runs, files.
"""
