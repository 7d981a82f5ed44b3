"""Recordings: writing and reading bags, and the summary of a run."""
