"""Shared code of all packages: errors, configuration, geometry, compiled kernels, ROS helpers."""
