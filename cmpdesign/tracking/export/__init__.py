"""Runs exported for the training of policies: LeRobot data sets and replay buffers.

In: the .npz files of ``track`` and ``reconstruct``, one file for each episode, and optionally images. Out: a
LeRobotDataset folder (v3.0), or a Zarr group in the replay-buffer form of Diffusion Policy.
"""
