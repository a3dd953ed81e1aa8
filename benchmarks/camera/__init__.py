"""``python -m benchmarks.camera``: share of markers and errors in pictures with the effects of cameras."""
