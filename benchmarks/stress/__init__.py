"""``python -m benchmarks.stress``: how far each kind of damage and distortion may go."""
