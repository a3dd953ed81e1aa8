"""Calibrations as files and pictures.

In: a calibration. Out: texts of TOML and YAML files, a picture of the rays' errors.
"""
