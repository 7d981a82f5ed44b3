"""
Information bound: how accurate gains can be after presses, and contacts with these gains.

Unknown are all gains, which scatter randomly, and place and shear of every press; all presses have
the same known force. The noise is that of the images. Contacts are fitted with optimal weights.
"""

import numpy as np

from benchmarks.contact.fe_frames import DEPTH
from benchmarks.contact.real_skin import ARRAYS, NOISE
from benchmarks.harness import table
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.types.skin import Skin

ARRAY, SKIN, PATCH = ARRAYS['16x16'], Skin(DEPTH, 6e-3, 0.45), 0.5e-3  # radius [m]
SPREAD, SHEAR = 0.1, 0.1  # standard deviations of the gains, and of shear / force
BALLS, REACH = 20, (8e-3, 11e-3)  # presses of the ball; largest distances of both kinds [m]
CONTACTS, STEP = 60, 1e-6
# Number of presses, True if evenly distributed over the pad, frames of each press.
CASES = ((40, False, 1), (80, False, 1), (120, False, 1), (40, True, 1), (60, True, 1),
         (40, False, 10), (40, True, 10))


def slopes(pressure, a, b):
    """Return the pressure of a unit force and its derivatives by place and shear, (tactels, 5)."""
    x, y = ARRAY.x[None, :], ARRAY.y[:, None]

    def basis(a, b):
        return pressure.point_basis(x, y, a, b, PATCH).reshape(-1, 3)
    here = basis(a, b)
    moved = [(basis(a + dx, b + dy) - here)[:, 0] / STEP for dx, dy in ((STEP, 0.0), (0.0, STEP))]
    return np.column_stack([here[:, 0], *moved, here[:, 1:]])


def covariance(pressure, places, noise, frames):
    """Return the covariance of the gains (tactels, tactels) after presses at places (N, 2)."""
    count = ARRAY.rows * ARRAY.columns
    # The mean of the gains has no prior: the known force determines it.
    information = (np.eye(count) - 1.0 / count) / SPREAD**2 + 1e-3 * np.eye(count)
    for place in places:
        columns = slopes(pressure, *place) * np.sqrt(frames) / noise
        by_gain, own = np.diag(columns[:, 0]), columns[:, 1:]
        square = own.T @ own + np.diag([0.0, 0.0, SHEAR**-2, SHEAR**-2])
        information += by_gain**2 - (by_gain @ own) @ np.linalg.solve(square, own.T @ by_gain)
    return np.linalg.inv(information)


def errors(pressure, gains, noise, places):
    """Return RMS errors (place [m], force) of contacts, with and without unknown shear, (2, 2)."""
    squares = np.zeros((len(places), 2, 2))
    for i, place in enumerate(places):
        columns = slopes(pressure, *place)
        by_gain = columns[:, :1] * gains * columns[:, 0]
        weight = 1.0 / (noise**2 + np.diag(by_gain))
        for k, used in enumerate((columns, columns[:, :3])):
            inverse = np.linalg.solve((used.T * weight) @ used, used.T * weight)
            of_all = inverse @ (noise**2 * np.eye(len(weight)) + by_gain) @ inverse.T
            squares[i, k] = 0.5 * (of_all[1, 1] + of_all[2, 2]), of_all[0, 0]
    return np.sqrt(squares.mean(axis=0))


def drawn(count, evenly, rng, reach):
    """Draw places of presses (count, 2) [m]; if evenly, near the points of a grid."""
    if not evenly:
        return rng.uniform(-reach, reach, (count, 2))
    side = round(count**0.5)
    rows = -(-count // side)
    grid = np.stack(np.meshgrid(*((np.arange(n) + 0.5) / n for n in (side, rows))), -1)
    near = grid.reshape(-1, 2)[:count] + rng.uniform(-0.3, 0.3, (count, 2)) / (side, rows)
    return (2.0 * near - 1.0) * reach


def bound(seeds):
    """Return the table of least errors after presses, relative to those with uniform gains."""
    sizes = ARRAY.pitch_x, ARRAY.pitch_y
    pressure = SkinPressure(SKIN, *sizes)
    noise = NOISE * float(SkinPressure(SKIN).point(0.0, 0.0, 0.0, 0.0, 1.0, radius=PATCH))
    rows, inner = [], np.zeros(ARRAY.shape, bool)
    inner[3:-3, 3:-3] = True
    for count, evenly, frames in CASES:
        found = []
        for seed in range(seeds):
            rng = np.random.default_rng(seed)
            contacts = rng.uniform(-REACH[0], REACH[0], (CONTACTS, 2))
            places = np.concatenate([drawn(BALLS, False, rng, REACH[0]),
                                     drawn(count, evenly, rng, REACH[1])])
            gains = covariance(pressure, places, noise, frames)
            found.append([np.full((2, 2), np.sqrt(np.diag(gains)[inner.ravel()].mean())),
                          errors(pressure, gains, noise, contacts),
                          errors(pressure, 0.0 * gains, noise, contacts)])
        left, off, uniform = np.sqrt(np.mean(np.square(found), axis=0))
        over, more = off / uniform, np.sqrt(off**2 - uniform**2)
        rows.append([str(count), 'evenly' if evenly else 'anywhere', str(frames),
                     f'{100.0 * left[0, 0]:.1f} %', f'{over[0, 0]:.2f}', f'{over[1, 0]:.2f}',
                     f'{over[0, 1]:.2f}', f'{100.0 * more[0, 1]:.2f} %'])
    return table(['presses', 'where', 'frames of each', 'gains, inner', 'place over uniform',
                  'without shear', 'force over uniform', 'more force error'], rows)
