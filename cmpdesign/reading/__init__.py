"""Layout files and pictures read back: a ``Layout`` from ``layout.json``, and the verdict on a picture.

In: a layout file, images. Out: a ``Layout``; a ``Verdict`` with its reason.
"""
