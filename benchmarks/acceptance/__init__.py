"""``python -m benchmarks.acceptance``: wrong positions against lost markers, over the threshold of acceptance."""
