"""Scene files and sequences: TOML checked and composed, key frames, the writing of frames.

In: a TOML file and a ``Layout``. Out: scenes, one for every frame.
"""
