"""Our extractor and other detectors on the same scenes."""
