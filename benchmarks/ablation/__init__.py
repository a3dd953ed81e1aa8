"""``python -m benchmarks.ablation``: what each rule of the reader is worth."""
