"""Atomic writing of files, and the formats that several rooms use: images, video, ``layout.json``.

In: bytes, arrays, a ``Layout``. Out: files, and the contents of files.
"""
