"""Solids built face by face with shared edges, measured and tessellated, independent of molds.

In: loops and levels in mm. Out: OCP solids, their measures, their triangles.
"""
