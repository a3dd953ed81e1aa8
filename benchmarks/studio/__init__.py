"""The times of the studio's page: ``python -m benchmarks.studio``."""
