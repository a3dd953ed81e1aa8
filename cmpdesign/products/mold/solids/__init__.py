"""Solids built face by face with shared edges, measured and tessellated. They know nothing of molds.

In: loops and levels in mm. Out: OCP solids, their measures, their triangles.
"""
