"""``python -m benchmarks.live``: what live viewers and files cost, and whether a queue grows."""
