"""Robot model, limits, tactile servo and mock robot."""
