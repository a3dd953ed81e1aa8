"""``python -m benchmarks.sweeps``: steps of light that are refused between two that are read."""
