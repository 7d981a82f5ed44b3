"""Contact estimation: the least model that explains a tactile image."""
