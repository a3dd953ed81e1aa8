"""The Cramer-Rao bound of a scene: how precisely its image can tell the markers' places at all.

In: a ``Scene``. Out: covariances.
"""
