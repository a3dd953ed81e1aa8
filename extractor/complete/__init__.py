"""Stage 8 and virtual markers: contradicting markers are dropped, lost ones repaired, points between them placed.

In: refined markers. Out: markers with their status, virtual markers with theirs.
"""
