"""Stop distance of the pad."""
