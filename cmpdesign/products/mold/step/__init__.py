"""STEP AP242 files, the same bytes for the same solids.

In: solids, or the texts of parts' files. Out: texts.
"""
