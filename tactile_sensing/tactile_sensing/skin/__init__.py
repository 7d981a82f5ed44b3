"""Pressure in a layer of skin on a rigid backing, under point and line loads."""
