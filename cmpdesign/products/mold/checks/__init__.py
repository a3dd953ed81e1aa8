"""Checks of a mold before it is made.

In: a ``MoldStack`` and its settings. Out: ``Finding`` records: walls, distances of features, features that cannot be
cast.
"""
