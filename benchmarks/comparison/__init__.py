"""Speed against error: the extractor's presets, other detectors and the article's corners on the same scenes."""
