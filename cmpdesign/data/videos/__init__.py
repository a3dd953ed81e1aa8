"""Videos and pictures in parts that are read independently.

In: files, and a part's first frame and length. Out: places at which files can be cut; the markers of a part's frames.
"""
