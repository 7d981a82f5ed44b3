"""Calibrate an array from recordings of raw counts; used by the command `calibrate`."""
