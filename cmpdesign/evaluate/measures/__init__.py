"""What the experiments measure: single cells, edges, the pressed cube, reconstructed shapes.

In: pictures, markers or surfaces. Out: figures.
"""
