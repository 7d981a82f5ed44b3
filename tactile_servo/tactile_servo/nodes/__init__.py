"""ROS 2 nodes of tactile_servo."""
