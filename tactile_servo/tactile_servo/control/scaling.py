"""Bounds, ramps and slopes that controllers share; plain numbers, for numpy's take ten times."""


def clipped(value: float, low: float, high: float) -> float:
    """Value within bounds; NaN stays."""
    return low if value < low else high if value > high else value


def ramp(value: float, zero_at: float, one_at: float) -> float:
    """How far a value is on the way from where it counts nothing to where it counts in full."""
    return clipped((value - zero_at) / (one_at - zero_at), 0.0, 1.0)


def slewed(value: float, wanted: float, change: float) -> float:
    """Value moved towards the wanted one by no more than a change."""
    return value + clipped(wanted - value, -change, change)
