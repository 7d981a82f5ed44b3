"""Plain data types that describe a surface."""
