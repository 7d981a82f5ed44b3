"""Edge tracking by touch: the whole ROS graph, its demo and its report."""
