"""What touches the pad, and what is wrong with it: loads with their bounds, faults, scenes."""
