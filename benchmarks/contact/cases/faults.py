"""Faults of the skin, of the sensor and of what is assumed of them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.contact.cases.loads import DEPTH, LINE_ARRAY, POINT_ARRAY, POINT_PEAK
from tactile_sensing.half_space import line, point
from tactile_sensing.types.contact import ContactType, line_offsets

DECIBELS = 40.0
REACH = 8e-3  # m
LINE_FORCE = 200.0  # N/m

# A point has x, y, P, Qx and Qy, a line x, y, yaw, line_force and line_shear (both per length), as
# the estimator's records name them; the rest is 0. A line's (x, y) is nearest to the pad's centre.
LOAD = np.dtype([(name, 'f8') for name in (
    'x', 'y', 'yaw', 'normal_force', 'shear_force_x', 'shear_force_y', 'line_force',
    'line_shear')])


@dataclass(frozen=True)
class Sample:
    """
    Frames (N, rows, columns) [Pa] with what is known and what is told of them.

    truth are LOAD records; noise, full_scale, floor [Pa] and depth [m] are what the estimator is
    told.
    """

    kind: ContactType
    truth: np.ndarray
    frames: np.ndarray
    noise: float
    depth: float = DEPTH
    full_scale: float = 0.0
    floor: float = 0.0

    @property
    def array(self):
        """Geometry of the tactels."""
        return POINT_ARRAY if self.kind == ContactType.POINT else LINE_ARRAY

    @property
    def peak(self):
        """Pressure above the load without shear [Pa]."""
        return peak_of(self.kind)

    @property
    def force(self):
        """Normal force of every load [N], or per length [N/m]."""
        return 1.0 if self.kind == ContactType.POINT else LINE_FORCE


def peak_of(kind):
    """Pressure above the load of a kind without shear [Pa]."""
    return POINT_PEAK if kind == ContactType.POINT else line.peak_pressure(LINE_FORCE, DEPTH)


def clean(kind, truth):
    """Noise-free frames of loads."""
    t = truth[:, None, None]
    if kind == ContactType.POINT:
        return point.stress('zz', POINT_ARRAY.x, POINT_ARRAY.y[:, None], t['x'], t['y'],
                            t['normal_force'],
                            t['shear_force_x'], t['shear_force_y'], DEPTH)
    return line.stress_with_shear(
        LINE_ARRAY.x, LINE_ARRAY.y[:, None], line_offsets(t), t['yaw'], t['line_force'],
        t['line_shear'], DEPTH)


def noisy(kind, truth, rng, decibels=DECIBELS, pictures=None):
    """Sample of loads, or of pictures of other things, with noise."""
    pictures = clean(kind, truth) if pictures is None else pictures
    noise = peak_of(kind) * 10.0 ** (-decibels / 20.0)
    return Sample(kind, truth, pictures + noise * rng.standard_normal(pictures.shape), noise)


def draw(kind, count, rng, shear=(0.0, 0.5)):
    """
    Parameters of loads with |x|, |y| <= 8 mm or |offset| <= 8 mm, |yaw| <= 40 degrees.

    Shear is from so much to so much of the force: in any direction for a point, across a line
    with either sign.
    """
    truth = np.zeros(count, LOAD)
    ratio = rng.uniform(*shear, count)
    place = rng.uniform(-REACH, REACH, count)
    if kind == ContactType.POINT:
        turn = rng.uniform(-np.pi, np.pi, count)
        truth['x'], truth['y'] = place, rng.uniform(-REACH, REACH, count)
        truth['normal_force'] = 1.0
        truth['shear_force_x'], truth['shear_force_y'] = ratio * np.cos(turn), ratio * np.sin(turn)
    else:
        _lay(truth, place, np.radians(rng.uniform(-40.0, 40.0, count)))
        truth['line_force'] = LINE_FORCE
        truth['line_shear'] = LINE_FORCE * ratio * rng.choice([-1, 1], count)
    return truth


def _lay(truth, offset, yaw):
    """Lay lines at a distance from the centre."""
    truth['x'], truth['y'], truth['yaw'] = offset * np.cos(yaw), offset * np.sin(yaw), yaw


def sample(kind, count, rng, **options):
    """Loads as a line mostly is: without shear across it; a point with up to half of P."""
    shear = (0.0, 0.5) if kind == ContactType.POINT else (0.0, 0.0)
    return noisy(kind, draw(kind, count, rng, shear), rng, **options)


# ------------------------------------------------------------------------------- faults

def near_border(kind, count, rng, millimetres):
    """Point at a distance from the border; line at a distance from one that it is along."""
    truth = draw(kind, count, rng, (0.0, 0.5 if kind == ContactType.POINT else 0.0))
    half = (POINT_ARRAY if kind == ContactType.POINT else LINE_ARRAY).half_width_x
    place = rng.choice([-1.0, 1.0], count) * (half - 1e-3 * millimetres)
    if kind == ContactType.LINE:
        _lay(truth, place, np.radians(rng.uniform(-2.0, 2.0, count)))
    else:
        truth['x'] = place
    return noisy(kind, truth, rng)


def noise(kind, count, rng, decibels):
    """Peak signal to noise."""
    return sample(kind, count, rng, decibels=decibels)


def full_scale(kind, count, rng, percent):
    """Tactels saturate at a share of the peak, which is declared."""
    given = sample(kind, count, rng)
    level = 0.01 * percent * given.peak
    return replace(given, frames=np.minimum(given.frames, level), full_scale=level)


def saturated_nan(kind, count, rng, percent):
    """Tactels above a share of the peak are NaN."""
    given = sample(kind, count, rng)
    return replace(given, frames=np.where(
        given.frames > 0.01 * percent * given.peak, np.nan, given.frames))


def clipped(kind, count, rng, percent):
    """Tactels saturate at a share of the peak, and nobody says so."""
    given = sample(kind, count, rng)
    return replace(given, frames=np.minimum(given.frames, 0.01 * percent * given.peak))


def _lost(kind, count, rng, percent, value):
    given = sample(kind, count, rng)
    lost = rng.random(given.frames.shape) < 0.01 * percent
    return replace(given, frames=np.where(lost, value * given.peak, given.frames))


def dead(kind, count, rng, percent):
    """Tactels read 0 without a word."""
    return _lost(kind, count, rng, percent, 0.0)


def dead_nan(kind, count, rng, percent):
    """Dead tactels are listed, and so NaN."""
    return _lost(kind, count, rng, percent, np.nan)


def stuck(kind, count, rng, percent):
    """Tactels read twice the peak."""
    return _lost(kind, count, rng, percent, 2.0)


def drift(kind, count, rng, percent):
    """Every tactel reads more by a share of the peak."""
    given = sample(kind, count, rng)
    return replace(given, frames=given.frames + 0.01 * percent * given.peak)


def threshold(kind, count, rng, percent):
    """What is below a share of the peak reads 0."""
    given = sample(kind, count, rng)
    level = 0.01 * percent * given.peak
    return replace(given, frames=np.where(given.frames < level, 0.0, given.frames), floor=level)


def wrong_depth(kind, count, rng, percent):
    """Tactels are told to be deeper, or shallower, than they are."""
    return replace(sample(kind, count, rng), depth=DEPTH * (1.0 + 0.01 * percent))


def shear(kind, count, rng, ratio):
    """Shear of so many times the normal force; friction allows about 1."""
    return noisy(kind, draw(kind, count, rng, (ratio, ratio)), rng)


def patch(kind, count, rng, millimetres):
    """Hertz pressure over a disc of this radius, or a strip of this half width; no shear."""
    truth = draw(kind, count, rng, (0.0, 0.0))
    radius = 1e-3 * millimetres
    if kind == ContactType.POINT:  # equal forces at the middle of equal shares of Hertz'
        share = (np.arange(12)[:, None] + 0.5) / 12
        distance = radius * np.sqrt(1.0 - (1.0 - share) ** (2.0 / 3.0))
        turn = 2.0 * np.pi * (np.arange(8) + 0.5 * np.arange(12)[:, None]) / 8
        offsets = np.stack([distance * np.cos(turn), distance * np.sin(turn)], -1).reshape(-1, 2)
        parts = [_changed(truth, x=truth['x'] + x, y=truth['y'] + y) for x, y in offsets]
    else:  # Gauss-Chebyshev of the second kind: exact for a half ellipse
        angle = np.pi * np.arange(1, 9) / 9
        parts = [_changed(
            truth, x=truth['x'] + radius * np.cos(t) * np.cos(truth['yaw']),
            y=truth['y'] + radius * np.cos(t) * np.sin(truth['yaw']),
            line_force=truth['line_force'] * 16 / 9 * np.sin(t) ** 2) for t in angle]
    pictures = sum(clean(kind, part) for part in parts) / len(parts)
    return noisy(kind, truth, rng, pictures=pictures)


def _changed(truth, **columns):
    changed = truth.copy()
    for name, column in columns.items():
        changed[name] = column
    return changed


@dataclass(frozen=True)
class Fault:
    """A fault, how its size is called, the sizes tried, the harmless one first."""

    name: str
    axis: str
    make: Callable
    levels: tuple


FAULTS = (
    Fault('border', 'distance from it [mm]', near_border,
          (8, 5, 3, 2, 1, .5, 0, -.5, -1, -2, -3)),
    Fault('noise', 'peak SNR [dB]', noise,
          (60, 50, 40, 30, 25, 20, 18, 16, 14, 12, 8)),
    Fault('saturation, full scale declared', 'at [% of the peak]', full_scale,
          (110, 90, 80, 70, 60, 50, 40, 30, 20, 10)),
    Fault('saturation as NaN', 'above [% of the peak]', saturated_nan,
          (110, 90, 80, 70, 60, 50, 40, 30, 20, 10)),
    Fault('clipping that nobody tells', 'at [% of the peak]', clipped,
          (110, 95, 90, 80, 70, 60, 50, 40, 30, 20)),
    Fault('dead tactels, not listed', 'reading 0 [% of tactels]', dead, (0, 1, 2, 5, 10, 15, 20)),
    Fault('dead tactels, listed', 'NaN [% of tactels]', dead_nan, (0, 5, 10, 20, 40, 60, 80)),
    Fault('tactels stuck high', 'at twice the peak [% of tactels]', stuck,
          (0, .2, .5, 1, 2, 3.5, 5)),
    Fault('drift of the baseline', 'by [% of the peak]', drift, (0, .5, 1, 2, 3, 5, 7, 10)),
    Fault('threshold', 'zero below [% of the peak]', threshold, (0, 2, 3, 4, 5, 10, 15, 20)),
    Fault('depth told wrongly', 'by [%]', wrong_depth,
          (-20, -10, -5, -3, -1, 0, 1, 3, 5, 10, 20)),
    Fault('shear', '[times the normal force]', shear, (0, .25, .5, 1, 1.5, 2, 3, 4)),
    Fault('Hertz patch', 'radius or half width [mm]', patch, (0, .25, .5, .75, 1, 1.5, 2)))
