"""Bags: ROS 1, ROS 2 and MCAP containers, bulk decoding, and several topics on one clock."""
