"""Tactile arrays: device protocols, calibration, synthetic sensor and contact estimation."""
