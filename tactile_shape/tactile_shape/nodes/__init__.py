"""ROS nodes: each callback converts, calls the core once and publishes."""
