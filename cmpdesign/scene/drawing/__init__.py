"""Rendering of a scene: views, exact coverage, occlusion, and the truth.

In: a ``Scene``. Out: an image and its ``Truth``.
"""
