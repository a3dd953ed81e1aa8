"""``python -m benchmarks.camera``: how much is read, and how precisely, in pictures as cameras make them."""
