"""Servo laws, and the registry of them."""
