"""Surface matrices, local curvature and object shape from the kinematics of contact."""
