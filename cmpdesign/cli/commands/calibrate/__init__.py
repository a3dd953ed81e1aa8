"""The group of commands ``cmpdesign calibrate``.

In: layouts and pictures on the command line. Out: files that state what was measured of one sensor.
"""
