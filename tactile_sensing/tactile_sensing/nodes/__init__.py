"""ROS nodes of the tactile sensor: thin shells around the core modules."""
