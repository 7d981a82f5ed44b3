"""The edge as the pictures drew it: path, corners, ends."""
