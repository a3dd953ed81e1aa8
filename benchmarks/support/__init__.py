"""What several benchmarks share: the machine, scenes, scan lines, published figures."""
