"""One sensor in one file: views, medium, elastomer, calibrations, and the pad's layout by name.

In: sensor.toml, or what it shall hold. Out: checked tables with the rig; the text of a file with some tables replaced.
"""
