"""Recordings for ROS 2 and Foxglove: frames as messages in an MCAP file or a rosbag2 folder.

In: the columns of tracked frames in chunks, the shared columns, the kept images. Out:
one .mcap file, or a folder with metadata.yaml and one .mcap file.
"""
