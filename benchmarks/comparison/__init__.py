"""Speed against error: the extractor's presets, its rivals and the article's corners on the same scenes."""
