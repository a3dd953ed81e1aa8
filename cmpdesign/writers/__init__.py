"""Compatibility with version 0.1. New programs import these names from ``cmpdesign``."""
