"""Contact with Coulomb friction as a quadratic program, one increment after the other.

In: an elastic layer, an object, its motion. Out: tractions and displacements.
"""
