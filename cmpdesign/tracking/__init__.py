"""Tracking from a source into a file: sources, tables, overlay video, quiver plot and summary.

In: a video, images or a camera, a ``Tracker`` or ``ShapeTracker``. Out: files.
"""
