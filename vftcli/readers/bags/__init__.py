"""Bags: ROS 1, ROS 2 and MCAP containers, decoded in bulk, topics on one clock."""
