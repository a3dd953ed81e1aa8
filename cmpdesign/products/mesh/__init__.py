"""Triangle meshes: STL, GLB and 3MF, and pictures of them.

In: named, colored meshes in mm. Out: the bytes of files.
"""
