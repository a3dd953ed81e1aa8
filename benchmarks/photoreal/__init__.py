"""``python -m benchmarks.photoreal``: pictures of an independent path tracer, read and compared with their truth."""
