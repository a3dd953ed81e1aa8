"""STEP AP242 files, the same bytes for the same solids.

In: solids, or the bytes of parts' files. Out: bytes.
"""
