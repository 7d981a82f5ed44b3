"""Contact estimation: find the simplest load that explains a tactile image."""
