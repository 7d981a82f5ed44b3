"""What all packages share: errors, configuration, geometry, compiled kernels, ROS helpers."""
