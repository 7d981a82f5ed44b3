"""The golden sets by name: loads on pads, as arrays with their truth."""

from collections.abc import Callable
from functools import cached_property, partial
import math
from pathlib import Path
from zlib import crc32

import numpy as np

from benchmarks.contact import golden_pictures as pictures
from benchmarks.contact.fe_frames import DEPTH
from benchmarks.contact.golden_fe import BACKINGS, chosen, more_profiles, NARROW, POISSON
from benchmarks.contact.golden_pictures import FAULTS, Pad, PEAK, unit

NOISE = 0.01 * PEAK  # 40 dB
PADS = {'16x16': Pad(16, 16, 25.4e-3 / 16), '26x26': Pad(26, 26, 1e-3)}
# Other pads, with a scale factor relative to the finite elements.
SMALL = {'4x4-4mm': (Pad(4, 4, 4e-3), 2.0), '5x5-3.5mm': (Pad(5, 5, 3.5e-3), 2.0),
         '6x6-3mm': (Pad(6, 6, 3e-3), 1.5), '8x8-2mm': (Pad(8, 8, 2e-3), 1.0),
         '8x8-4mm': (Pad(8, 8, 4e-3), 1.5), '32x32-1mm': (Pad(32, 32, 1e-3), 1.0)}
POINT_FORCE, LINE_FORCE = 1.0, 200.0  # N, N/m
POINT_PEAK, LINE_PEAK = 1.5 / (np.pi * DEPTH**2), 2.0 * LINE_FORCE / (np.pi * DEPTH)
# Stress and depth of the layers of a half-space's pad.
STRUCTURES = {'m1': (('zz', DEPTH),), 'm2': (('zz', DEPTH), ('zz', 2 * DEPTH)),
              'm3': (('zz', DEPTH), ('xz', DEPTH))}
DRIFT, SCATTER = 0.03, 0.05  # drifted pads: offset as a share of the peak, gain scatter
OBJECTS = {'ball': 'ball', 'wedge': 'wedge', 'cylinder': 'cylinder', 'punch': 'round punch',
           'strip': 'strip'}
COLUMNS = {'point': ('x', 'y', 'normal_force', 'shear_force_x', 'shear_force_y'),
           'line': ('rho', 'yaw', 'line_force', 'line_shear', 'across')}


def packed(frames, pad, noise, kind, truth=None, *, depth=DEPTH, **more) -> dict:
    """
    Return the arrays of a set.

    `truth` contains x, y, rho, yaw [m, rad], force [N or N/m] and similar values.
    """
    frames = np.asarray(frames, np.float32)
    return {'frames': frames if frames.ndim == 4 else frames[:, None], 'pitch_x': pad.pitch,
            'pitch_y': pad.pitch, 'noise': noise, 'depth': depth, 'thickness': math.inf,
            'poisson': 0.5, 'full_scale': 0.0, 'kind': kind, 'components': ['zz'],
            'depths': [depth], **(truth or {}), **more}


# ----------------------------------------------------------------------------- half-space

def _image(kind, pad, structure, load):
    """Return the layers (L, rows, columns) [Pa] of one load on a half-space."""
    if kind == 'line':
        return np.stack([pictures.averaged(pad, lambda x, y, d=depth: pictures.line_stress(
            x, y, load, d)) for _, depth in structure])
    return np.stack([pictures.averaged(pad, lambda x, y, c=component, d=depth: (
        pictures.point_stress(c, x, y, load, d))) for component, depth in structure])


def _bound(kind, pad, structure, load, noise, middle=None, drifted=False):
    """Return the least standard deviations (5,) of COLUMNS for noise [Pa], see `crb`."""
    steps = (1e-6, 1e-6, 1e-3, 1e-3, 1e-3) if kind == 'point' else (1e-6, 1e-5, 0.1, 0.1)
    columns = []
    for k, step in enumerate(steps):
        change = np.zeros(len(steps))
        change[k] = step
        columns.append((_image(kind, pad, structure, load + change)
                        - _image(kind, pad, structure, load - change)).ravel() / (2.0 * step))
    spread = noise
    if drifted:
        mean = _image(kind, pad, structure, load).ravel()
        spread = np.sqrt(noise**2 + (SCATTER * mean)**2)
        columns.append(np.ones_like(mean))
    jacobian = np.stack(columns, axis=-1) / np.reshape(spread, (-1, 1))
    scale = np.linalg.norm(jacobian, axis=0)
    jacobian = jacobian / scale
    covariance = np.linalg.inv(jacobian.T @ jacobian) / np.outer(scale, scale)
    found = np.sqrt(np.diagonal(covariance))[:len(steps)]
    if kind == 'line':
        lever = np.zeros(len(covariance))
        lever[:2] = -1.0, middle @ unit(load[1] + 0.5 * np.pi)
        found = np.append(found, np.sqrt(lever @ covariance @ lever))
    return found


def half_space(rng, count, kind, pad, decibels, *, shear=(0.0, 0.3), model='m1', drifted=False):
    """Return loads on a half-space with Cramer-Rao bounds; drifted: with offset, gain scatter."""
    structure = STRUCTURES[model]
    place = pictures.points_on(pad, count, rng) if kind == 'point' else pictures.lines_on(
        pad, count, rng)
    ratio, turn = rng.uniform(*shear, count), rng.uniform(-np.pi, np.pi, count)
    if kind == 'point':
        force, peak = np.full(count, POINT_FORCE), POINT_PEAK
        pushed = {'shear_x': force * ratio * np.cos(turn), 'shear_y': force * ratio * np.sin(turn)}
        loads = np.column_stack([place['x'], place['y'], force, *pushed.values()])
    else:
        force, peak = np.full(count, LINE_FORCE), LINE_PEAK
        pushed = {'line_shear': force * ratio * np.sign(turn)}
        loads = np.column_stack([place['rho'], place['yaw'], force, *pushed.values()])
    noise = peak * 10.0**(-decibels / 20.0)
    frames = np.array([_image(kind, pad, structure, load) for load in loads])
    bounds = [_bound(kind, pad, structure, load, noise, np.array([x, y]), drifted)
              for load, x, y in zip(loads, place['x'], place['y'], strict=True)]
    if drifted:
        frames = frames * (1.0 + SCATTER * rng.standard_normal(frames.shape))
        frames += peak * DRIFT * rng.uniform(-1.0, 1.0, (count, 1, 1, 1))
    frames = frames + noise * rng.standard_normal(frames.shape)
    components, depths = zip(*structure, strict=True)
    return packed(frames, pad, noise, kind, {**place, 'force': force, **pushed}, crb=bounds,
                  crb_names=COLUMNS[kind], components=components, depths=depths)


def dome(rng, count):
    """Return points on a round probe of 27 mm with tactels 2 mm below the surface."""
    pad = PADS['16x16']
    place, force = pictures.points_on(pad, count, rng), np.full(count, POINT_FORCE)
    frames = np.array([pictures.averaged(pad, lambda x, y, a=a, b=b: pictures.dome_stress(
        x, y, (a, b, 1.0), 27e-3, 25e-3)) for a, b in zip(place['x'], place['y'], strict=True)])
    noise = 0.01 * POINT_PEAK
    frames += noise * rng.standard_normal(frames.shape)
    return packed(frames, pad, noise, 'point', {**place, 'force': force})


# ------------------------------------------------------------------------ finite elements

class Skins:
    """Sets that need the finite-element profiles, which are stored in a folder."""

    def __init__(self, folder: Path):
        self.folder = folder
        self._kept: dict = {}

    @cached_property
    def table(self):
        """PROFILE records."""
        return more_profiles(self.folder)

    def known(self, backing, scale=1.0, poisson=POISSON):
        """Return the skin parameters that are given to the estimator."""
        bone = BACKINGS[backing]
        backed = {} if bone == math.inf else {'thickness': scale * bone, 'poisson': poisson}
        return {'depth': scale * DEPTH, **backed}

    def superposed(self, pad, backing):
        """Return the superposition of loads on a skin, and the profile under a line on it."""
        key = pad, backing
        if key not in self._kept:
            point, line = (chosen(self.table, kind, BACKINGS[backing], radius=NARROW)[0]
                           for kind in ('round punch', 'strip'))
            self._kept[key] = pictures.Superposed(pad, point), line
        return self._kept[key]

    def objects(self, rng, count, what, pad, backing, *, scale=1.0, poisson=POISSON,
                fault='none', radius=None, within=None):
        """Return objects of all radii (or of one) at random places, 40 dB, with a given fault."""
        profiles = chosen(self.table, OBJECTS[what], BACKINGS[backing], poisson, radius=radius)
        kind = 'point' if OBJECTS[what] in pictures.ROUND else 'line'
        place = (pictures.points_on(pad, count, rng) if kind == 'point'
                 else pictures.lines_on(pad, count, rng, within=within))
        names = ('x', 'y') if kind == 'point' else ('rho', 'yaw')
        where = np.column_stack([place[name] for name in names])
        number = rng.integers(len(profiles), size=count)
        clean, ghosts = np.zeros((2, count, pad.rows, pad.columns))
        for i, (one, at) in enumerate(zip(profiles[number], where, strict=True)):
            clean[i] = pictures.indented(pad, one, at, scale)
            if FAULTS[fault].ghost:
                step = 2e-3 * unit(rng.uniform(-np.pi, np.pi))
                step = step if kind == 'point' else [step @ unit(at[1]), 0.0]
                ghosts[i] = pictures.indented(pad, one, at + step, scale)
        share = PEAK / clean.max(axis=(1, 2))
        frames = pictures.faulty(clean * share[:, None, None], ghosts * share[:, None, None],
                                 NOISE, FAULTS[fault], rng)
        force = profiles['force'][number] * share * scale**(2 if kind == 'point' else 1)
        return packed(frames, pad, NOISE, kind, {**place, 'force': force},
                      radius=profiles['radius'][number] * scale,
                      full_scale=FAULTS[fault].full_scale, **self.known(backing, scale, poisson))

    def scene(self, rng, count, name, pad, backing):
        """Return images of scenes that are neither a point nor a line, 40 dB."""
        point, line = self.superposed(pad, backing)
        clean = np.array([pictures.SCENES[name](pad, point, line, rng) for _ in range(count)])
        clean *= PEAK / clean.max(axis=(1, 2), keepdims=True)
        return packed(clean + NOISE * rng.standard_normal(clean.shape), pad, NOISE, 'other',
                      **self.known(backing))

    def edges(self, rng, count, picture, pad, backing):
        """Return edges that end on the pad or press unevenly, 40 dB."""
        point, _ = self.superposed(pad, backing)
        frames, places = zip(*[picture(pad, point, rng) for _ in range(count)], strict=True)
        frames, (x, y, rho, yaw) = np.array(frames), np.array(places).T
        frames *= PEAK / frames.max(axis=(1, 2), keepdims=True)
        return packed(frames + NOISE * rng.standard_normal(frames.shape), pad, NOISE, 'line',
                      {'x': x, 'y': y, **pictures.half_turn(rho, yaw)}, **self.known(backing))


def nothing(rng, count, pad, drift):
    """Return only noise, or an inclined offset of 3 to 30 % of a load's peak."""
    frames = NOISE * rng.standard_normal((count, pad.rows, pad.columns))
    if drift:
        x, y = np.meshgrid(pad.x / pad.half, pad.y / pad.half)
        offset = PEAK * rng.uniform(0.03, 0.3, (count, 1, 1)) * rng.choice([-1, 1], (count, 1, 1))
        slope = 0.2 * rng.uniform(-1.0, 1.0, (2, count, 1, 1))
        frames += offset * (1.0 + slope[0] * x + slope[1] * y)
    return packed(frames, pad, NOISE, 'none')


# ---------------------------------------------------------------------------------- sets

def _half_sets():
    for pad_name, pad in PADS.items():
        for kind in ('point', 'line'):
            for decibels in (20, 30, 40, 50, 60):
                name = f'half/{kind}-{pad_name[:2]}-{decibels}dB'
                yield name, 300, partial(half_space, kind=kind, pad=pad, decibels=decibels)
                if decibels != 50:
                    yield f'drifted/{kind}-{pad_name[:2]}-{decibels}dB', 200, partial(
                        half_space, kind=kind, pad=pad, decibels=decibels, drifted=True)
            for label, shear in (('small', (0.04, 0.08)), ('big', (0.3, 0.7)), ('no', (0, 0))):
                yield f'half/{kind}-{pad_name[:2]}-{label}-shear', 300, partial(
                    half_space, kind=kind, pad=pad, decibels=40, shear=shear)
    for model in ('m2', 'm3'):
        for decibels in (20, 40, 60):
            yield f'half/point-26-{decibels}dB-{model}', 300, partial(
                half_space, kind='point', pad=PADS['26x26'], decibels=decibels, model=model)


def _fe_sets(skins):
    press = skins.objects
    for what in ('ball', 'wedge', 'cylinder'):
        for bone in BACKINGS:
            for name, pad in PADS.items():
                yield f'fe/{what}-{bone}-{name[:2]}', 250, partial(
                    press, what=what, pad=pad, backing=bone)
    for what in ('ball', 'wedge'):
        for bone in ('2mm', '4mm'):
            for poisson in (0.3, 0.49):
                yield f'fe/{what}-{bone}-nu{100 * poisson:.0f}', 250, partial(
                    press, what=what, pad=PADS['16x16'], backing=bone, poisson=poisson)
    for bone in BACKINGS:
        yield f'fe/cylinder-{bone}-saturated-rows', 250, partial(
            press, what='cylinder', pad=PADS['16x16'], backing=bone, fault='saturated',
            within=np.radians(2.0))
    for what in ('ball', 'wedge'):
        for bone in ('4mm', 'none'):
            for name, (pad, scale) in SMALL.items():
                yield f'pads/{what}-{bone}-{name}', 250, partial(
                    press, what=what, pad=pad, backing=bone, scale=scale)


def _flat_sets(skins):
    coarse = {'16x16': PADS['16x16'], '8x8-2mm': SMALL['8x8-2mm'][0],
              '8x8-4mm': SMALL['8x8-4mm'][0]}
    for what in ('punch', 'strip'):
        for bone in ('2mm', '4mm', 'none'):
            for name, pad in coarse.items():
                for radius in (1e-3, 2e-3, 3e-3):
                    yield f'flat/{what}-{2e3 * radius:.0f}mm-{bone}-{name}', 60, partial(
                        skins.objects, what=what, pad=pad, backing=bone, radius=radius)


def _other_sets(skins):
    for what in ('ball', 'wedge'):
        for bone in ('3mm', 'none'):
            for fault in FAULTS:
                yield f'faults/{what}-{bone}-{fault}', 250, partial(
                    skins.objects, what=what, pad=PADS['16x16'], backing=bone, fault=fault)
    for name, pad in PADS.items():
        yield f'reject/nothing-{name[:2]}', 300, partial(nothing, pad=pad, drift=False)
        yield f'reject/drift-{name[:2]}', 300, partial(nothing, pad=pad, drift=True)
        for bone in ('3mm', 'none'):
            for scene in pictures.SCENES:
                yield f'reject/{scene}-{bone}-{name[:2]}', 150, partial(
                    skins.scene, name=scene, pad=pad, backing=bone)
            for label, picture in (('short/blade', pictures.blade),
                                   ('short/end', pictures.edge_end),
                                   ('uneven/edge', pictures.tapered),
                                   ('uneven/wavy', pictures.wavy)):
                yield f'{label}-{bone}-{name[:2]}', 200, partial(
                    skins.edges, picture=picture, pad=pad, backing=bone)
    yield 'dome/point', 300, dome


def all_sets(folder: Path) -> dict[str, tuple[int, Callable]]:
    """Return for every set its number of images and its generator (rng, count) -> arrays."""
    skins = Skins(folder)
    parts = _half_sets(), _fe_sets(skins), _flat_sets(skins), _other_sets(skins)
    return {name: (count, make) for part in parts for name, count, make in part}


def made(name: str, count: int, make: Callable, seed: int) -> dict:
    """Return the arrays of one set; they depend only on its name and the seed."""
    return make(np.random.default_rng([seed, crc32(name.encode())]), count)
