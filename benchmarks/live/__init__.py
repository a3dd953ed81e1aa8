"""``python -m benchmarks.live``: time of live viewers and files per frame, and growth of the queue."""
