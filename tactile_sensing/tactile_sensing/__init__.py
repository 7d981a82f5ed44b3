"""Tactile arrays: devices, calibration and contact estimation."""
