"""The article's experiments on simulated sensors, and the comparison of designs.

In: a sensor file, patterns, contacts. Out: trials in a journal, figures, ``report.json`` and ``report.html``.
"""
