"""``python -m benchmarks.views``: views without the white cell, read where one motion fits their cells only."""
