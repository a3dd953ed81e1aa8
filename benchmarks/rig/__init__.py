"""What each step of a sensor's calibration gains in depth."""
