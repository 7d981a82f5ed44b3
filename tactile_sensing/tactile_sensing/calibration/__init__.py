"""Calibrating an array from recordings of raw counts: what `calibrate` does."""
