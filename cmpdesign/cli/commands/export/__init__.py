"""The group of commands ``cmpdesign export``.

In: .npz files of ``track`` and ``reconstruct`` on the command line. Out: data sets for the training of policies.
"""
