"""The simulated world: scenes, rendered tactile images, mock sensor and robot, closed loop."""
