"""Map of an edge from images: path, corners and ends."""
