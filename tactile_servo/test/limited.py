"""What no command can pass, for the tests."""

from tactile_servo.motion.limits import Joints


def limit_velocities(limits, positions, previous, wanted, dt, coast=0.0):
    """Velocities that the guard leaves of the wanted ones, and what it names."""
    return limits.guard(wanted, limits.reach(Joints(positions, previous), dt, coast))
