"""Tactile servo: one supervisor, servo laws, edge map, controllers and robot motion."""
