"""Reading of layout files, and verification of images against a layout.

In: a layout file, images. Out: a ``Layout``; a ``Verdict`` with its reason.
"""
