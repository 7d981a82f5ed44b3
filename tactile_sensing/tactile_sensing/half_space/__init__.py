"""Compiled loads on an elastic half-space, and approximation of a skin by half-spaces."""
