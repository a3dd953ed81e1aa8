"""A simulated sensor: its file, its conditions, its contacts, and the instrument that reads its pictures.

In: a sensor's TOML and a design. Out: the sensor's measurements, and the truth.
"""
