"""Cameras that are calibrated from pictures of a sheet: errors of rays against truth, and residuals of real corners."""
