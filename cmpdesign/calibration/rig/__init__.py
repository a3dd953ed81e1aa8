"""The calibration of a rig from the pad at rest and from steps of a plate, and the check of a calibrated rig.

In: markers in all views, and how well camera, window and gel are known. Out: the rig with what remains undetermined.
"""
