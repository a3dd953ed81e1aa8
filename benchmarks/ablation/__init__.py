"""``python -m benchmarks.ablation``: the effect of each rule of the reader."""
