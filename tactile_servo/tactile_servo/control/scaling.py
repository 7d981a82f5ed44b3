"""Bounds, ramps and slew limits for controllers, on floats: numpy would take ten times as long."""

# Measured force over wanted force: a pad stands still below LIFTED and above CROWDED, and keeps
# its speed between LIGHTEST and HEAVIEST.
LIFTED, LIGHTEST = 0.3, 0.7
HEAVIEST, CROWDED = 1.1, 1.3


def clipped(value: float, low: float, high: float) -> float:
    """Limit a value to bounds; NaN stays NaN."""
    return low if value < low else high if value > high else value


def ramp(value: float, zero_at: float, one_at: float) -> float:
    """Return a linear ramp, 0 to 1, that is 0 up to one value and 1 from the other value on."""
    return clipped((value - zero_at) / (one_at - zero_at), 0.0, 1.0)


def slewed(value: float, wanted: float, change: float) -> float:
    """Move a value towards the wanted one by at most `change`."""
    return value + clipped(wanted - value, -change, change)


def caution(pressed: float, astray: float) -> float:
    """
    Return the factor, 0 to 1, by which to reduce the speed of a pad.

    `pressed` is the measured over the wanted force; `astray` the deviation from the path, 0 where
    the pad keeps its speed and 1 where it stops.
    """
    return (ramp(pressed, LIFTED, LIGHTEST) * ramp(pressed, CROWDED, HEAVIEST)
            * ramp(astray, 1.0, 0.0))
