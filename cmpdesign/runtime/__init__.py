"""Running sensors: the newest frame of each camera read, in time, with what was dropped and why.

In: sensor files. Out: sensors with their latest results, their events and their health.
"""
