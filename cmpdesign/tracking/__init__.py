"""Tracking from a source into a file: sources, tables, overlay, plot and summary around ``extractor.Tracker``."""
