"""Kept for programs written against version 0.1; new ones take these names from ``cmpdesign``."""
