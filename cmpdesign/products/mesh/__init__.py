"""Triangle meshes as STL, GLB and 3MF files, and pictures of triangle meshes.

In: ``TriangleMesh`` values in mm. Out: bytes of files, (H, W, 3) pictures.
"""
