"""Files that appear whole or not at all, and the formats that several rooms share: images, video, ``layout.json``.

In: bytes, arrays, a ``Layout``. Out: files, and what files hold.
"""
