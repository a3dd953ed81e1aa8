"""``python -m benchmarks.stress``: the tolerated strength of each kind of damage and distortion."""
