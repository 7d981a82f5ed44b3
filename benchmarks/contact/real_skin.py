"""Finite-element frames of objects on a skin on bone, with tactels that average their area."""

from dataclasses import dataclass

import numpy as np

from benchmarks.contact.fe_frames import DEPTH
from benchmarks.contact.golden_pictures import indented, Pad, ROUND
from benchmarks.contact.golden_score import score
from tactile_sensing.contact.estimator import ContactEstimator
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer

ARRAYS = {'16x16': TactelArray(16, 16, 25.4e-3 / 16, 25.4e-3 / 16),
          '26x26': TactelArray(26, 26, 1e-3, 1e-3)}
NOISE = 0.01  # as a share of the highest tactel: 40 dB


@dataclass(frozen=True)
class Judged:
    """Shares of frames, and errors of the right ones."""

    right: float
    wrong: float
    refused: float
    force: float  # mean error of the force
    claims: float  # RMS of the place's error over its claim
    force_claims: float


def rendered(profile, array, places):
    """
    Return frames (N, rows, columns) [Pa] of an object at places (N, 2).

    The places are x and y, or rho and yaw.
    """
    pad = Pad(array.rows, array.columns, array.pitch_x)
    return np.array([indented(pad, profile, place) for place in places])


def drawn(profile, count, rng):
    """Draw places (N, 2) of an object on the pad: x and y, or rho and yaw."""
    high = (8e-3, 8e-3) if profile['kind'] in ROUND else (6e-3, np.radians(45))
    return rng.uniform(np.negative(high), high, (count, 2))


def pictures(profile, array, count, rng):
    """Return noisy frames (N, rows, columns) [Pa], places (N, 2) as in `drawn`, and the noise."""
    places = drawn(profile, count, rng)
    frames = rendered(profile, array, places)
    noise = NOISE * frames.max()
    return frames + noise * rng.standard_normal(frames.shape), places, noise


def estimates(profile, array, frames, noise, layer=None, **config):
    """Return the estimates of frames, with the true skin or that of a layer."""
    known = {} if profile['backing'] == np.inf else {
        'thickness': float(profile['backing']), 'poisson': float(profile['poisson'])}
    layer = layer or Layer('zz', DEPTH, np.empty(0), noise_std=noise, **known)
    return ContactEstimator(config.pop('config', None)).estimate_batch(frames, array, [layer])


def judge(profile, places, found):
    """Judge the estimates of one profile's frames, see `golden_score.score`."""
    truth = dict.fromkeys(('x', 'y'), np.zeros(len(places)))
    if profile['kind'] in ROUND:
        truth |= {'kind': 'point', 'x': places[:, 0], 'y': places[:, 1]}
    else:  # at the foot of the perpendicular from the pad's centre
        rho, yaw = places.T
        truth |= {'kind': 'line', 'rho': rho, 'yaw': yaw, 'x': rho * np.cos(yaw),
                  'y': rho * np.sin(yaw)}
    row = score(truth | {'force': np.full(len(places), profile['force'])}, found)
    return Judged(row['right'] - row['wrong_force'], row['wrong'], row['refused'],
                  row['force_bias'], row['claim_place'], row['claim_force'])
