"""Pressure within a layer of skin on a rigid backing, below point and line loads."""
