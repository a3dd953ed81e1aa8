"""Force from displacement, compared with large-strain finite elements.

In: a pad, its elastomer, objects that press, shear and twist. Out: errors of force, torque and regions.
"""
