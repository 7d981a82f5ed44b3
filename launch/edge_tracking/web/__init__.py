"""Shared parts of the pages of report and live view, and their scripts."""
