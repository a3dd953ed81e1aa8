"""Laser jobs: from a layout to tool paths (kerf, corners, fill, order), what they leave, and the files."""
