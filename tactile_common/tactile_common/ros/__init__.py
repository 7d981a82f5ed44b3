"""ROS helpers: running nodes, parameters from dataclasses, time and pose conversions."""
