"""The extractor and other detectors on the same scenes."""
