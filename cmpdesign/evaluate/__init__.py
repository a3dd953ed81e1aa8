"""The article's experiments on simulated sensors, and the comparison of designs.

sensor file + patterns + contacts -> trials -> journal -> figures -> report.json, report.html
"""
