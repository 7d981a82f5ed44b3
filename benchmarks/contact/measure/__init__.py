"""What the contact benchmark measures: accuracy and speed, limits, remedies, operations."""
