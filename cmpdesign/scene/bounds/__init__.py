"""The Cramer-Rao bound of a scene: the smallest possible covariance of marker positions measured in its image.

In: a ``Scene``. Out: covariances.
"""
