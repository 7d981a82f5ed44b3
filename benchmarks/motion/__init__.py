"""Solvers of quadratic programs for the differential inverse kinematics, and windows."""
