"""ROS nodes: convert, one core call, publish."""
