"""Moments of a tactile image and the closed forms of the thesis."""
