"""Calibration: cameras and rigs from numbered points in their pictures, with covariances.

In: pixels of points whose places on a sheet or a pad are known. Out: intrinsics and poses, what determines them, and
the pictures that contradict.
"""
