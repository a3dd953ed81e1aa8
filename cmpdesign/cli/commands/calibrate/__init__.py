"""The group of commands ``cmpdesign calibrate``.

In: layouts and pictures on the command line. Out: files with the measured properties of one sensor.
"""
