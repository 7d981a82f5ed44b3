"""ROS nodes of the tactile sensor; the algorithms are in the core modules."""
