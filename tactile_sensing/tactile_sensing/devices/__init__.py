"""Devices: serial protocols, calibration from counts to pressure, recordings."""
