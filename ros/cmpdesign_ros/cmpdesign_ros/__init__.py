"""Tactile sensors as a ROS 2 node."""
