"""Inconsistent markers are dropped, lost markers repaired, virtual markers located.

In: refined markers. Out: markers with their status, virtual markers with theirs.
"""
