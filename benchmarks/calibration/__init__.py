"""``python -m benchmarks.calibration``: errors over stated covariances, in all suites, for all presets."""
