"""Plain data: what is said of a surface."""
