"""Stage 8 and virtual markers: inconsistent markers are dropped, lost markers repaired, virtual markers located.

In: refined markers. Out: markers with their status, virtual markers with theirs.
"""
