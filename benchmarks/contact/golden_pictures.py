"""
Images of known loads for the golden sets: closed forms, finite elements, scenes and faults.

It shares no code with the estimator: the closed forms are written again, and tactels average their
area with 5x5 points. Lengths are in m, pressures in Pa.
"""

from typing import NamedTuple

import numpy as np

from benchmarks.contact.fe_frames import RADII

PEAK = 4e4  # highest tactel of a finite-element image [Pa]
NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)
ROUND = 'ball', 'round punch'
TABLE_STEP, TABLE_END = 0.05e-3, 35e-3  # table of one load's pressure [m]


class Pad(NamedTuple):
    """Rectangular array of tactels, centred on the origin."""

    rows: int
    columns: int
    pitch: float  # m

    @property
    def x(self):
        """Centres of the columns (columns,) [m]."""
        return (np.arange(self.columns) - 0.5 * (self.columns - 1)) * self.pitch

    @property
    def y(self):
        """Centres of the rows (rows,) [m]."""
        return (np.arange(self.rows) - 0.5 * (self.rows - 1)) * self.pitch

    @property
    def half(self):
        """Half of the shorter side [m]."""
        return 0.5 * min(self.rows, self.columns) * self.pitch


def unit(angle):
    """Return unit vectors (..., 2) at angles [rad]."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def averaged(pad: Pad, pressure) -> np.ndarray:
    """Return the mean of a function of x and y over each tactel's area (rows, columns) [Pa]."""
    dx, dy = np.meshgrid(0.5 * pad.pitch * NODES, 0.5 * pad.pitch * NODES)
    share = np.multiply.outer(WEIGHTS, WEIGHTS) / 4.0
    values = pressure(pad.x + dx[..., None, None], pad.y[:, None] + dy[..., None, None])
    return np.einsum('ij,ijkl->kl', share, values)


# ------------------------------------------------------------------------------- places

def chord(pad: Pad, rho: float, yaw: float) -> tuple[float, float]:
    """Return where a line enters and leaves the rectangle of tactel centres, along it [m]."""
    n, low, high = unit(yaw), -np.inf, np.inf
    halves = 0.5 * (pad.columns - 1) * pad.pitch, 0.5 * (pad.rows - 1) * pad.pitch
    for foot, slope, half in ((rho * n[0], -n[1], halves[0]), (rho * n[1], n[0], halves[1])):
        if abs(slope) < 1e-12:
            if abs(foot) > half:
                return 0.0, 0.0
            continue
        one, other = sorted(((-half - foot) / slope, (half - foot) / slope))
        low, high = max(low, one), min(high, other)
    return (low, high) if high > low else (0.0, 0.0)


def points_on(pad: Pad, count: int, rng) -> dict:
    """Draw places of points on the pad, at least 1.5 tactels (small pads: 1) from the border."""
    inset = (1.5 if min(pad.rows, pad.columns) >= 8 else 1.0) * pad.pitch
    x, y = rng.uniform(-1.0, 1.0, (2, count)) * (pad.half - inset)
    return {'x': x, 'y': y}


def lines_on(pad: Pad, count: int, rng, *, within: float | None = None) -> dict:
    """
    Draw lines of all directions with a chord of at least 6 tactels, or 0.75 of the pad.

    x, y is the middle of the chord. With `within` [rad] the lines are nearly along a row or a
    column.
    """
    least = min(6.0, 0.75 * min(pad.rows, pad.columns)) * pad.pitch
    rows = []
    while len(rows) < count:
        yaw = rng.uniform(-0.5 * np.pi, 0.5 * np.pi)
        if within is not None:
            yaw = rng.choice([0.0, 0.5 * np.pi]) + rng.uniform(-within, within)
        rho = rng.uniform(-1.5, 1.5) * pad.half
        low, high = chord(pad, rho, yaw)
        if high - low >= least:
            middle = 0.5 * (low + high)
            x, y = rho * unit(yaw) + middle * unit(yaw + 0.5 * np.pi)
            rows.append((x, y, rho, yaw))
    x, y, rho, yaw = np.array(rows).T
    return {'x': x, 'y': y, **half_turn(rho, yaw)}


def half_turn(rho, yaw) -> dict:
    """Return the same lines with yaw in (-pi/2, pi/2]."""
    turns = np.ceil(np.asarray(yaw) / np.pi - 0.5)
    return {'rho': rho * np.where(turns % 2, -1.0, 1.0), 'yaw': yaw - np.pi * turns}


# ------------------------------------------------------------------------- closed forms

def point_stress(component, x, y, load, depth):
    """Boussinesq and Cerruti: stress [Pa] under (x, y, P, Qx, Qy) [m, N]; (2.2), (2.5)."""
    u, v = x - load[0], y - load[1]
    lever = {'zz': 1.0, 'xz': u / depth, 'yz': v / depth}[component]
    force = load[2] * depth + load[3] * u + load[4] * v
    return 1.5 / np.pi * depth**2 * lever * force * (u * u + v * v + depth**2)**-2.5


def line_stress(x, y, load, depth):
    """Flamant: pressure [Pa] under a line of (rho, yaw, force, shear) [m, rad, N/m]; (3.1)."""
    v = x * np.cos(load[1]) + y * np.sin(load[1]) - load[0]
    return 2.0 / np.pi * depth**2 * (load[2] * depth + load[3] * v) / (v * v + depth**2)**2


def dome_stress(x, y, load, skin_radius, array_radius):
    """Return the pressure [Pa] under a point load on a dome: a half-space below its tangent."""
    def outward(px, py):
        angle = np.hypot(px, py) / array_radius
        share = np.sinc(angle / np.pi) / array_radius
        return np.stack([share * px, share * py, np.cos(angle)], axis=-1)
    tactel, contact = outward(x, y), outward(*np.array(load[:2]))
    way = array_radius * tactel - skin_radius * contact
    square = (way * way).sum(axis=-1)
    inward = -(way @ contact) * load[2]
    faced = (way * tactel).sum(axis=-1)
    return 1.5 / np.pi * inward * faced**2 * square**-2.5


# --------------------------------------------------------------------- finite elements

def indented(pad: Pad, profile, place, scale: float = 1.0) -> np.ndarray:
    """Return the tactels (rows, columns) [Pa] under an object at (x, y) or (rho, yaw)."""
    def pressure(x, y):
        if profile['kind'] in ROUND:
            distance = np.hypot(x - place[0], y - place[1])
        else:
            distance = np.abs(x * np.cos(place[1]) + y * np.sin(place[1]) - place[0])
        return np.interp(distance, scale * RADII, profile['pressure'])
    return averaged(pad, pressure)


class Superposed:
    """Pressure of many loads on one skin, from a table of the effect of one load on a tactel."""

    def __init__(self, pad: Pad, profile):
        steps = np.arange(0.0, TABLE_END + 2 * TABLE_STEP, TABLE_STEP)
        self.pad, total = pad, 0.0
        for dx, wx in zip(NODES, WEIGHTS, strict=True):
            for dy, wy in zip(NODES, WEIGHTS, strict=True):
                away = np.hypot(steps + 0.5 * pad.pitch * dx,
                                (steps + 0.5 * pad.pitch * dy)[:, None])
                total = total + wx * wy / 4.0 * np.interp(away, RADII, profile['pressure'])
        self.table = total / profile['force']

    def __call__(self, places: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return the tactels (rows, columns) [Pa] under forces (K,) [N] at places (K, 2)."""
        dx = np.abs(self.pad.x - places[:, :1])[:, None, :]
        dy = np.abs(self.pad.y - places[:, 1:])[:, :, None]
        fx, fy = (np.minimum(d, TABLE_END) / TABLE_STEP for d in (dx, dy))
        i, j = fx.astype(int), fy.astype(int)
        fx, fy = fx - i, fy - j
        one = self.table[j, i] * (1 - fx) + self.table[j, i + 1] * fx
        other = self.table[j + 1, i] * (1 - fx) + self.table[j + 1, i + 1] * fx
        return np.einsum('k,kij->ij', forces, one * (1 - fy) + other * fy)


# -------------------------------------------------------------------------------- scenes

def two_balls(pad, point, line, rng):
    """Return two loads 5 to 10 mm apart; the second has half to all of the first one's force."""
    while True:
        first = rng.uniform(-1, 1, 2) * (pad.half - 2e-3)
        second = first + rng.uniform(5e-3, 10e-3) * unit(rng.uniform(-np.pi, np.pi))
        if np.abs(second).max() < pad.half - 2e-3:
            return point(np.array([first, second]), np.array([1.0, rng.uniform(0.5, 1.0)]))


def crossing(pad, point, line, rng):
    """Return two edges across the whole pad that cross at 40 to 140 degrees."""
    at, yaw = rng.uniform(-4e-3, 4e-3, 2), rng.uniform(-np.pi, np.pi)
    other = yaw + np.radians(rng.uniform(40, 140))
    return indented(pad, line, (at @ unit(yaw), yaw)) + rng.uniform(0.6, 1.0) * indented(
        pad, line, (at @ unit(other), other))


def ridges(pad, point, line, rng):
    """Return two parallel edges 4 mm apart."""
    yaw, rho = rng.uniform(-np.pi, np.pi), rng.uniform(-8e-3, 4e-3)
    return indented(pad, line, (rho, yaw)) + rng.uniform(0.8, 1.2) * indented(
        pad, line, (rho + 4e-3, yaw))


def half_plate(pad, point, line, rng):
    """Return a plate on about half of the pad: uniform, or higher at its edge (rigid plate)."""
    v = np.arange(-45e-3, 45e-3, 0.1e-3)
    reach = rng.choice([0.0, rng.uniform(0.5e-3, 3e-3)])
    inside = np.maximum(v + 0.05e-3, 0.05e-3)
    step = np.where(v >= 0, 1.0, 0.0) / np.sqrt(-np.expm1(-inside / reach) if reach else 1.0)
    blur = np.interp(np.abs(v), RADII, line['pressure'])
    seen = np.convolve(step, blur, mode='same')
    yaw, rho = rng.uniform(-np.pi, np.pi), rng.uniform(-6e-3, 6e-3)
    return averaged(pad, lambda x, y: np.interp(
        x * np.cos(yaw) + y * np.sin(yaw) - rho, v, seen))


def _legs(rng, spread=4e-3):
    first = rng.uniform(-np.pi, np.pi)
    return rng.uniform(-spread, spread, 2), unit(first), unit(first + 0.5 * np.pi)


def corner(pad, point, line, rng):
    """Return two edges that end where they meet, at 90 degrees."""
    at, one, other = _legs(rng)
    along = np.arange(0.1e-3, 25e-3, 0.3e-3)[:, None]
    loads = np.r_[np.ones(len(along)), np.full(len(along), rng.uniform(0.7, 1.0))]
    return point(np.concatenate([at + along * one, at + along * other]), loads)


def tilted_corner(pad, point, line, rng):
    """Return the tilted corner of a box: face and edges press less with distance from the tip."""
    at, one, other = _legs(rng)
    far = rng.uniform(4e-3, 10e-3)  # end of the contact
    along = np.arange(0.25e-3, far, 0.5e-3)
    u, v = (part.ravel() for part in np.meshgrid(along, along * rng.uniform(0.7, 1.0)))
    face = np.maximum(1.0 - (u + v) / far, 0.0) * 0.5
    edge = 1.0 - along / far  # 1 mm of the face's pressure
    places = np.concatenate([u[:, None] * one + v[:, None] * other, along[:, None] * one,
                             along[:, None] * other])
    return point(at + places, np.concatenate([face, edge, edge]))


def box_corner(pad, point, line, rng):
    """Return the flat corner of a box: a quarter of a plate, higher along its two edges."""
    at, one, other = _legs(rng)
    along = np.arange(0.3e-3, 24e-3, 0.6e-3)
    u, v = (part.ravel() for part in np.meshgrid(along, along))
    face = np.full(len(u), 0.6)
    edge = np.full(len(along), rng.uniform(0.5, 2.0))
    places = np.concatenate([u[:, None] * one + v[:, None] * other, along[:, None] * one,
                             along[:, None] * other])
    return point(at + places, np.concatenate([face, edge, edge]))


SCENES = {'two-balls': two_balls, 'crossing': crossing, 'ridges-4mm': ridges,
          'half-plate': half_plate, 'corner': corner, 'corner-tilted': tilted_corner,
          'corner-box': box_corner}


def blade(pad, point, rng, length=8e-3):
    """Return a short edge in the middle of the pad: tactels, and x, y, rho, yaw of its middle."""
    middle, yaw = rng.uniform(-4e-3, 4e-3, 2), rng.uniform(-np.pi, np.pi)
    along = np.linspace(-0.5 * length, 0.5 * length, 41)[:, None]
    frame = point(middle + along * unit(yaw + 0.5 * np.pi), np.ones(len(along)))
    return frame, (*middle, middle @ unit(yaw), yaw)


def edge_end(pad, point, rng):
    """Return an edge with an end on the pad, at least 10 mm of it there, as `blade` does."""
    while True:
        end, yaw = rng.uniform(-8e-3, 8e-3, 2), rng.uniform(-np.pi, np.pi)
        ahead = unit(yaw + 0.5 * np.pi)
        on_pad = chord(pad, end @ unit(yaw), yaw)[1] - end @ ahead
        if on_pad > 10e-3:
            break
    along = np.arange(0.1e-3, on_pad + 12e-3, 0.3e-3)[:, None]
    frame = point(end + along * ahead, np.ones(len(along)))
    return frame, (*(end + 0.5 * on_pad * ahead), end @ unit(yaw), yaw)


def tapered(pad, point, rng):
    """Return an edge that presses harder on one side, by 10 to 80 % at half the pad's size."""
    slope = rng.choice([-1, 1]) * rng.uniform(0.1, 0.8)
    return _uneven(pad, point, rng, lambda along: 1.0 + slope * along)


def wavy(pad, point, rng):
    """Return an edge with waves of 10 to 40 % of the force, as long as .3 to 1.5 pads."""
    size, phase = rng.uniform(0.1, 0.4), rng.uniform(0.0, 2.0 * np.pi)
    turns = np.pi / rng.uniform(0.3, 1.5)
    return _uneven(pad, point, rng, lambda along: 1.0 + size * np.sin(turns * along + phase))


def _uneven(pad, point, rng, force):
    """Return an edge across the pad; `force` takes places along it in halves of the pad."""
    place = {name: value[0] for name, value in lines_on(pad, 1, rng).items()}
    n, along = unit(place['yaw']), np.arange(-1.5 * pad.half, 1.5 * pad.half, 0.3e-3)
    frame = point(place['rho'] * n + along[:, None] * unit(place['yaw'] + 0.5 * np.pi),
                  np.maximum(force(along / pad.half), 0.0))
    return frame, tuple(place.values())


# -------------------------------------------------------------------------------- faults

class Fault(NamedTuple):
    """Size of each fault, as a share of the peak or of a reading."""

    drift: float = 0.0
    dead_row: bool = False  # reads 0
    dead_column: bool = False  # reads NaN
    stuck: int = 0  # number of tactels at .6 of full scale
    gains: float = 0.0
    bits: int = 0
    saturated: float = 0.0  # full scale, given to the estimator
    crosstalk: float = 0.0  # to each of the four neighbours; the tactel loses it
    ghost: float = 0.0  # share of the image displaced by 2 mm
    threshold: float = -np.inf  # share of the peak below which readings are 0

    @property
    def full_scale(self) -> float:
        """Largest reading [Pa]; 0 if unknown."""
        return PEAK * (self.saturated or (1.2 if self.bits or self.stuck else 0.0))


FAULTS = {
    'none': Fault(), 'drift': Fault(drift=0.03), 'dead-row': Fault(dead_row=True),
    'dead-column': Fault(dead_column=True), 'stuck': Fault(stuck=3), 'gains': Fault(gains=0.15),
    '8bit': Fault(bits=8), 'saturated': Fault(saturated=0.6), 'crosstalk': Fault(crosstalk=0.05),
    'hysteresis': Fault(ghost=0.05), 'suppressed': Fault(threshold=0.05),
    'all': Fault(drift=0.015, dead_row=True, stuck=1, gains=0.05, bits=8, saturated=0.85,
                 crosstalk=0.02, ghost=0.02)}


def faulty(clean, ghosts, noise, fault: Fault, rng) -> np.ndarray:
    """Return frames (N, rows, columns) with noise and faults; ghosts are displaced images."""
    frames = clean + fault.ghost * ghosts
    padded = np.pad(frames, ((0, 0), (1, 1), (1, 1)), mode='edge')
    around = (padded[:, 2:, 1:-1] + padded[:, :-2, 1:-1] + padded[:, 1:-1, 2:]
              + padded[:, 1:-1, :-2])
    frames = frames + fault.crosstalk * (around - 4.0 * frames)
    frames = frames * (1.0 + fault.gains * rng.standard_normal(frames.shape))
    sign = rng.choice([-1.0, 1.0], (len(frames), 1, 1))
    frames = frames + PEAK * fault.drift * sign + noise * rng.standard_normal(frames.shape)
    full = fault.full_scale or np.inf
    frames = np.minimum(np.where(frames < fault.threshold * PEAK, 0.0, frames), full)
    if fault.bits:
        count = full / (2**fault.bits - 1)
        frames = np.round(frames / count) * count
    for frame in frames:
        if fault.dead_row:
            frame[rng.integers(frame.shape[0])] = 0.0
        if fault.dead_column:
            frame[:, rng.integers(frame.shape[1])] = np.nan
        frame.flat[rng.choice(frame.size, fault.stuck, replace=False)] = 0.6 * full
    return frames
