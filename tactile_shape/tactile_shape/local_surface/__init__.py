"""Local curvature from positions and normals of contact."""
