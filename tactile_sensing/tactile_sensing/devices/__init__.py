"""Devices: serial protocols, calibration of counts to pressure, recordings."""
