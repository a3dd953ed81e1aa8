"""Reconstruction from two or more views: from markers in images to the surface in space.

In: the markers of every view, a rig. Out: positions, displacements and normals in mm, with covariances.
"""
