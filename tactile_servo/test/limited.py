"""What no command can pass, for the tests."""

from tactile_servo.motion.limits import nearest


def limit_velocities(limits, positions, previous, wanted, dt, coast=0.0):
    """Nearest velocities to the wanted ones, their scale and the name of what bounds them most."""
    velocities, scale, kind, joint = nearest(
        *limits.bounds, positions, previous, wanted, dt, coast)
    return velocities, scale, limits.name_of(kind, joint)
