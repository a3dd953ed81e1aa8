"""Products of a design, one folder each; ``registry`` lists them all.

In: a ``Design`` and its ``Layout``. Out: files by name, figures and findings.
"""
