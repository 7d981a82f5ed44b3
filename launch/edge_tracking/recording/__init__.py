"""Recordings: writing and reading bags, and what a run was in numbers."""
