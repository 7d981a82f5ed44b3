"""Frames of finite elements: what touches a skin on bone, with tactels that average their area."""

from dataclasses import dataclass

import numpy as np

from benchmarks.contact.fe_frames import DEPTH, profiles, RADII
from tactile_sensing.contact.estimator import ContactEstimator
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import COLUMNS, ContactType, line_offsets
from tactile_sensing.types.image import Layer

ARRAYS = {'16x16': TactelArray(16, 16, 25.4e-3 / 16, 25.4e-3 / 16),
          '26x26': TactelArray(26, 26, 1e-3, 1e-3)}
ROUND = 'ball', 'round punch'
POINTS = 5  # along each side of a tactel, of the mean over it
NOISE = 0.01  # of the highest tactel: 40 dB
COLUMN_OF_FORCE = next(name for name, field in COLUMNS.items() if field.name == 'normal_force')
# Of wrong with confidence, see docs/contact.md.
FAR, FORCE_OFF, CLAIMS = 1e-3, 0.1, (3.0, 5.0)
LEAST = 1e-4, 0.02  # m and share of the force that nobody minds


@dataclass(frozen=True)
class Judged:
    """Shares of frames, and errors of those that are right."""

    right: float
    wrong: float
    refused: float
    force: float  # mean error, of the force
    claims: float  # RMS of the error of the place over what is claimed
    force_claims: float


def rendered(profile, array, places):
    """Frames (N, rows, columns) [Pa] of an object at places (N, 2): x and y, or rho and yaw."""
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    dx, dy = np.meshgrid(0.5 * array.pitch_x * nodes, 0.5 * array.pitch_y * nodes)
    share = np.multiply.outer(weights, weights)[..., None, None] / 4.0
    x, y = array.x + dx[..., None, None], array.y[:, None] + dy[..., None, None]
    frames = np.empty((len(places), *array.shape))
    for i, place in enumerate(places):
        if profile['kind'] in ROUND:
            distance = np.hypot(x - place[0], y - place[1])
        else:
            rho, yaw = place
            distance = np.abs(x * np.cos(yaw) + y * np.sin(yaw) - rho)
        pressure = np.interp(distance, RADII, profile['pressure'])
        frames[i] = (share * pressure).sum(axis=(0, 1))
    return frames


def drawn(profile, count, rng):
    """Places (N, 2) of an object on the pad: x and y, or rho and yaw."""
    high = (8e-3, 8e-3) if profile['kind'] in ROUND else (6e-3, np.radians(45))
    return rng.uniform(np.negative(high), high, (count, 2))


def pictures(profile, array, count, rng):
    """Frames (N, rows, columns) [Pa] with noise, places (N, 2) as of `drawn`, and the noise."""
    places = drawn(profile, count, rng)
    frames = rendered(profile, array, places)
    noise = NOISE * frames.max()
    return frames + noise * rng.standard_normal(frames.shape), places, noise


def estimates(profile, array, frames, noise, layer=None, **config):
    """What the estimator says of frames, given the true skin or that of a layer."""
    known = {} if profile['backing'] == np.inf else {
        'thickness': float(profile['backing']), 'poisson': float(profile['poisson'])}
    layer = layer or Layer('zz', DEPTH, np.empty(0), noise_std=noise, **known)
    return ContactEstimator(config.pop('config', None)).estimate_batch(frames, array, [layer])


def judge(profile, places, found):
    """Judge estimates of one profile's frames."""
    line = profile['kind'] in ('wedge', 'strip')
    kind = ContactType.LINE if line else ContactType.POINT
    valid, typed = found['valid'], found['type'] == kind
    covariance = found['covariance']
    if line:
        rho, yaw = places.T
        across = line_offsets(found) - rho
        turned = found['yaw'] - yaw
        off = np.abs(across + rho * (1.0 - np.cos(turned))) + 8e-3 * np.abs(np.sin(turned))
        sd = np.sqrt(covariance[:, 0, 0] + covariance[:, 1, 1])
        normalised = (found['x'] * np.cos(yaw) + found['y'] * np.sin(yaw) - rho) / sd
        force, force_sd = found['line_force'], np.sqrt(covariance[:, 6, 6])
        sd = np.hypot(sd, 8e-3 * np.sqrt(covariance[:, 2, 2]))
    else:
        off = np.hypot(found['x'] - places[:, 0], found['y'] - places[:, 1])
        sd = np.sqrt(np.maximum(covariance[:, 0, 0], covariance[:, 1, 1]))
        normalised = (found['x'] - places[:, 0]) / np.sqrt(covariance[:, 0, 0])
        force = found[COLUMN_OF_FORCE]
        force_sd = np.sqrt(covariance[:, 3, 3])
    error = force / profile['force'] - 1.0
    claimed = force_sd / profile['force']
    three, five = CLAIMS
    wrong = valid & ~(typed & (off <= FAR) & ~(
        (np.abs(error) > FORCE_OFF) & (np.abs(error) > three * claimed)) & ~(
        (off > LEAST[0]) & (off > five * sd)) & ~(
        (np.abs(error) > LEAST[1]) & (np.abs(error) > five * claimed)))
    right = valid & ~wrong
    return Judged(
        right.mean(), wrong.mean(), 1.0 - valid.mean(),
        float(np.mean(error[right])) if right.any() else np.nan,
        float(np.sqrt(np.mean(normalised[right]**2))) if right.any() else np.nan,
        float(np.sqrt(np.mean((error / claimed)[right]**2))) if right.any() else np.nan)


def all_profiles():
    """See `fe_frames.profiles`."""
    return profiles()
