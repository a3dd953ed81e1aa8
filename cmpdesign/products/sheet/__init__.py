"""Print sheets: pads on a page as SVG and PDF, and the verdict on a scan of the printed page.

In: a ``Layout`` and page options, or a scan. Out: SVG and PDF, or a ``SheetVerdict``.
"""
