"""Servo laws and their registry."""
