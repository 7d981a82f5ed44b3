"""Pictures on the 26x26 array of what may touch it, and how often the choice of model is right."""

import numpy as np

from benchmarks.contact.cases.loads import DEPTH, POINT_ARRAY, POINT_PEAK
from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.half_space import line
from tactile_sensing.types.contact import ContactType
from tactile_sensing.types.image import Layer

LEVELS = (20.0, 30.0, 40.0)  # peak signal to noise [dB]
ANSWERS = ('none', 'point', 'point + shear', 'line', 'line + shear', 'other', 'refused')
LINE_FORCE = 200.0  # N/m


def loads(points):
    """Pressure [Pa] of point loads (M, 5): a, b, P, Qx, Qy, shape (rows, columns)."""
    a, b, force, qx, qy = points.T[:, :, None, None]
    u, v = POINT_ARRAY.x - a, POINT_ARRAY.y[:, None] - b
    root = 1.0 / np.sqrt(u * u + v * v + DEPTH**2)
    cube = root * root * root
    return 1.5 / np.pi * DEPTH**2 * (
        (force * DEPTH + qx * u + qy * v) * cube * root * root).sum(axis=0)


def _pressed(places, force=1.0):
    places = np.atleast_2d(places)
    return loads(np.column_stack([places, np.broadcast_to(force, len(places)),
                                  np.zeros((len(places), 2))]))


def _unit(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def nothing(_):
    """No load."""
    return np.zeros(POINT_ARRAY.shape)


def point(rng):
    """Point load without shear."""
    return _pressed(rng.uniform(-8e-3, 8e-3, 2))


def sheared_point(rng):
    """Point load with shear of 0.1 to 0.5 P."""
    shear = rng.uniform(0.1, 0.5) * _unit(rng.uniform(-np.pi, np.pi))
    return loads(np.array([[*rng.uniform(-8e-3, 8e-3, 2), 1.0, *shear]]))


def edge(rng, shear=0.0):
    """Edge across the whole pad."""
    yaw, a = rng.uniform(-0.7, 0.7), rng.uniform(-8e-3, 8e-3)
    return line.stress_with_shear(POINT_ARRAY.x, POINT_ARRAY.y[:, None], a * np.cos(yaw), yaw,
                                  LINE_FORCE, shear * LINE_FORCE, DEPTH)


def sheared_edge(rng):
    """Edge with 0.3 of its force as shear across it."""
    return edge(rng, rng.choice([-0.3, 0.3]))


def two_points(rng):
    """Two loads 5 to 9 mm apart, the second of half to all of the force of the first."""
    while True:
        first = rng.uniform(-8e-3, 8e-3, 2)
        second = first + rng.uniform(5e-3, 9e-3) * _unit(rng.uniform(-np.pi, np.pi))
        if np.abs(second).max() < 12e-3:
            return _pressed([first, second], [1.0, rng.uniform(0.5, 1.0)])


def disc(rng):
    """Even pressure on a disc with a radius of 4 to 7 mm."""
    radius, centre = rng.uniform(4e-3, 7e-3), rng.uniform(-4e-3, 4e-3, 2)
    grid = np.mgrid[-1:1:17j, -1:1:17j].reshape(2, -1).T
    return _pressed(centre + radius * grid[np.hypot(*grid.T) <= 1.0])


def corner(rng):
    """Two edges of 20 mm that meet at 60 to 143 degrees."""
    first = rng.uniform(-np.pi, np.pi)
    sides = _unit(first), _unit(first + rng.uniform(np.pi / 3, 2.5))
    steps = np.arange(0.0, 0.02, 4e-4)[:, None]
    return _pressed(rng.uniform(-4e-3, 4e-3, 2) + np.concatenate([steps * s for s in sides]))


def edge_end(rng):
    """Edge that ends on the pad, 4 mm or more from its border."""
    steps = np.arange(0.0, 0.04, 4e-4)[:, None]
    centre = rng.uniform(-8e-3, 8e-3, 2)
    # Towards the farther side: at least 10 mm of it lie on the pad.
    angle = np.arctan2(*-centre[::-1]) + rng.uniform(-0.7, 0.7)
    return _pressed(centre + steps * _unit(angle))


SCENES = {  # name -> (picture, type)
    'nothing': (nothing, ContactType.NONE), 'point': (point, ContactType.POINT),
    'point with shear': (sheared_point, ContactType.POINT), 'edge': (edge, ContactType.LINE),
    'edge with shear': (sheared_edge, ContactType.LINE),
    'two points': (two_points, ContactType.OTHER), 'flat disc': (disc, ContactType.OTHER),
    'corner': (corner, ContactType.OTHER), 'end of an edge': (edge_end, ContactType.LINE)}


def pictures(name, count, rng):
    """Noise-free pictures of a scene (count, rows, columns) with the peak of 1 N [Pa]."""
    picture, _ = SCENES[name]
    clean = np.array([picture(rng) for _ in range(count)])
    highest = clean.max(axis=(1, 2), keepdims=True)
    return clean * POINT_PEAK / np.where(highest > 0.0, highest, 1.0)


def noise_of(decibels):
    """Noise of one tactel for `pictures` [Pa]."""
    return POINT_PEAK * 10.0 ** (-decibels / 20.0)


def answers(records):
    """Index into ANSWERS of every record."""
    kind = records['type'].astype(int)
    told = (kind == ContactType.POINT) | (kind == ContactType.LINE)
    shear = np.nan_to_num(np.hypot(records['shear_force_x'], records['shear_force_y'])) > 0.0
    found = np.select([kind == ContactType.NONE, kind == ContactType.OTHER, ~records['valid']],
                      [0, 5, 6], 2 * kind - 1 + shear)
    return np.where(told & ~records['valid'], 6, found)


def confusion(count, rng, progress):
    """Part (f): share of every answer for every scene, and of frames of the right type."""
    estimator, rows = ContactEstimator(EstimatorConfig(tactel='point')), []
    for name, (_, kind) in SCENES.items():
        progress.step(f'choice of model, {name}')
        clean = pictures(name, count, rng)
        for decibels in LEVELS:
            noise = noise_of(decibels)
            records = estimator.estimate_batch(
                clean + noise * rng.standard_normal(clean.shape), POINT_ARRAY,
                (Layer('zz', DEPTH, None, noise_std=noise),))
            shares = np.bincount(answers(records), minlength=len(ANSWERS)) / count
            rows.append({'scene': name, 'type': kind.name.lower(), 'decibels': decibels,
                         'answers': dict(zip(ANSWERS, shares.tolist(), strict=True)),
                         'right_type': float((records['type'] == kind).mean())})
    return rows
