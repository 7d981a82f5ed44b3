"""
Sets of real recordings, which are not in this repository: readings, pitch and noise alone.

The folder of recordings has any of:

- `remodel`: `*_step_01sec.mat` and `pesetti.mat` of Vanvitelli-Robotics/REMODEL;
- `interdigitation`: a clone of fkeel/interdigitation;
- `iscan_finger.npz`, `emed_step.npz`: images of a Tekscan I-Scan and of a Novel emed.
"""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.ndimage import label

from benchmarks.contact.golden_pictures import Pad
from benchmarks.contact.golden_sets import packed

SKIN = Pad(5, 5, 3.55e-3)
FOIL = Pad(1, 7, 5e-3)  # its pitch is not documented
# Assumed: normalised readings of the foil; rounding of the finger's counts; the foot's resolution.
NOISE = {'foil': 0.01, 'finger': 0.5, 'foot': 1.0}  # [1, counts, kPa]
UNLOADED = 200  # first images of a recording
LOADED = {'step': 0.1, 'weights': 0.05, 'foil': 0.3, 'finger': 10.0}  # peaks [V, V, 1, counts]


def _spread_out(frames, peak, count):
    """Return `count` images with at least this peak, evenly spread over the recording."""
    chosen = np.flatnonzero(frames.max(axis=(1, 2)) >= peak)
    return frames[chosen[np.linspace(0, len(chosen) - 1, count).astype(int)]]


def _skin(voltages):
    """Return the images of a pad of 5 x 5, tared by the first ones, and their noise [V]."""
    frames = np.asarray(voltages, float).T.reshape(-1, *SKIN[:2])
    return frames - np.median(frames[:UNLOADED], axis=0), frames[:UNLOADED].std(axis=0).mean()


def _areas(image):
    """Return how many areas of at least two tactels are pressed."""
    labels, count = label(np.nan_to_num(image) > 0.2 * np.nanmax(image), np.ones((3, 3)))
    return sum((labels == number).sum() > 1 for number in range(1, count + 1))


_set = partial(packed, depth=np.nan)  # the skin is unknown


def real_sets(folder: Path) -> Iterator[tuple[str, dict]]:
    """Yield name and arrays of each set whose recordings are there."""
    for number, file in enumerate(sorted(folder.glob('remodel/*_step_01sec.mat'))):
        frames, noise = _skin(loadmat(file)['volt'])
        yield f'real-loaded/{file.name.split("[")[0]}', _set(
            _spread_out(frames, LOADED['step'], 400), SKIN, noise, 'point',
            site=np.full(400, number))
    if (file := folder / 'remodel' / 'pesetti.mat').exists():
        frames, noise = _skin(loadmat(file)['tactile'])
        yield 'real-weights/weights', _set(
            _spread_out(frames, LOADED['weights'], 270), SKIN, noise, 'other')
    foils = [np.genfromtxt(file, delimiter=',', skip_header=1)
             for file in sorted(folder.glob('interdigitation/03_Normalized_Data/*.csv'))]
    if foils:
        site = np.concatenate([1000 * i + foil[:, 0] for i, foil in enumerate(foils)])
        strips = np.concatenate([foil[:, 3:10] for foil in foils])
        pressed = strips.max(axis=1) > LOADED['foil']
        yield 'real-foil/strips', _set(
            strips[pressed, None], FOIL, NOISE['foil'], 'point', site=site[pressed])
    if (file := folder / 'iscan_finger.npz').exists():
        data = np.load(file)
        frames = data['frames'][np.nanmax(data['frames'], axis=(1, 2)) > LOADED['finger']]
        alone = np.array([_areas(image) for image in frames]) == 1
        for name, kind, chosen in (('real-finger/one', 'point', alone),
                                   ('real-fingers/two', 'other', ~alone)):
            yield name, _set(frames[chosen], Pad(28, 28, float(data['pitch_m'])),
                             NOISE['finger'], kind)
    if (file := folder / 'emed_step.npz').exists():
        data = np.load(file)
        yield 'real-emed/foot', _set(
            data['pressure_kPa'], Pad(95, 64, float(data['pitch_m'])), NOISE['foot'],
            'other')
