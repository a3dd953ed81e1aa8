"""Print sheets: pads on a page, and the page read back from a scan.

In: a ``Layout`` and page options, or a scan. Out: SVG and PDF, or the verdict on the scan.
"""
