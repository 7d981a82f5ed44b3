"""Contours of edges: contacts in space, corners and sides, outline."""
