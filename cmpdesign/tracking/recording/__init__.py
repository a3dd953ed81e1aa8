"""Recordings for ROS 2 and Foxglove: frames as messages in an MCAP file or a rosbag2 folder.

In: the columns of tracked frames in chunks, the columns that they share, the images that were kept beside them. Out:
one .mcap file, or a folder with metadata.yaml and one .mcap file.
"""
