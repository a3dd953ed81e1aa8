"""Runs exported for the training of policies: LeRobot data sets and replay buffers.

In: the .npz files of ``track`` and ``reconstruct``, one an episode, and on wish their images. Out: a LeRobotDataset
folder (v3.0), or a Zarr group in the replay-buffer form of Diffusion Policy.
"""
