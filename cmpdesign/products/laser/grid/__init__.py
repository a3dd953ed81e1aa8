"""The grid: a test piece that shows which power, speed and number of passes cut through a sheet.

In: a job's setup. Out: a drawing, and from its photograph the settings for the material's file.
"""
