"""Replay of recordings through the cores of the nodes, without a graph."""
