"""Local curvature from contact positions and normals."""
