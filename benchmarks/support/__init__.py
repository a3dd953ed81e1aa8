"""Shared modules of the benchmarks: the machine, scenes, scan lines, published figures."""
