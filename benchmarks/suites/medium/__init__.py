"""Sensors with window and gel, and the errors of their depths."""
