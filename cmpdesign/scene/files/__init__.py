"""Scene files and sequences: TOML checked and composed, key frames, the film that is written.

In: a TOML file and a ``Layout``. Out: scenes, one for every frame.
"""
