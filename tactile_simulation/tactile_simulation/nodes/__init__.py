"""ROS nodes that stand in for a sensor and a robot."""
