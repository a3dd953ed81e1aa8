"""``python -m benchmarks.as_made``: displacements on scattered pads, read with nominal and with learnt layouts."""
