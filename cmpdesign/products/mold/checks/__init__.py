"""Checks of a mold before it is made.

In: a ``MoldStack`` and its settings. Out: ``Finding`` records: walls, distances of features, what cannot be cast.
"""
