"""Process sheets: the steps of making a pad, one page each, as HTML and PDF, and its bill of materials as CSV.

In: steps with texts, tables, pictures and warnings. Out: files to print.
"""
