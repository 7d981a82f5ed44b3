"""Recordings run through the same cores as the nodes, without a graph."""
