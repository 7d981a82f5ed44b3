"""Pages of report and live view: what they share, and their scripts."""
