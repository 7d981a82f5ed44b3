"""ROS nodes that simulate a sensor and a robot."""
