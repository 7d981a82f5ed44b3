"""Contours of edges: contacts in space, corners, sides and outline."""
