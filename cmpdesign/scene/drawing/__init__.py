"""A scene drawn: views, exact coverage, folds, and the truth.

In: a ``Scene``. Out: an image and its ``Truth``.
"""
