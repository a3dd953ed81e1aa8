"""The page in the browser: design, check, make, read and touch a pad.

In: requests of the page on this machine. Out: documents and files of the same calls that Python and the command line
use; no geometry is computed here.
"""
