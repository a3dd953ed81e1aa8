"""The markers' places on a pad as made, learnt from pictures of the pad at rest.

In: a nominal layout, pictures. Out: the same layout with measured places and their covariances.
"""
