"""``python -m benchmarks.medium``: depth through a window and a gel."""
