"""Kernels of loads on an elastic half-space, and a skin as a sum of half-spaces."""
