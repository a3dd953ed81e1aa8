"""What a design can be turned into, one folder a product; ``registry`` names them all.

In: a ``Design`` and its ``Layout``. Out: files by name, figures and findings.
"""
