"""From gridline offsets to markers: the Fisher information of all markers, its solution and its covariances.

In: offsets with weights. Out: shifts of the markers, their covariances, and the remaining error after the step.
"""
