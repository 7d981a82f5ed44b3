"""Stresses below point and line loads on an elastic half-space (chapters 2 and 3)."""
