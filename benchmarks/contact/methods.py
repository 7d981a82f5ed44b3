"""Methods of the contact benchmark: the estimator, the thesis' closed forms, and libraries."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
import importlib

import numpy as np

from benchmarks.contact import peers as peer
from benchmarks.contact.golden_score import layers_of
from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.types.image import TactileImage

FIT = 'estimator'
POINT_NAMES = 'x', 'y', 'normal_force', 'shear_force_x', 'shear_force_y'
LINE_NAMES = 'offset', 'yaw', 'line_force'


@dataclass(frozen=True)
class Method:
    """
    A method to estimate a contact.

    `one(frame)` returns the parameters of one (layers, rows, columns), NaN if there are none;
    `many(frames)` those of (N, layers, rows, columns). `peer` is the module of another library.
    """

    name: str
    one: Callable | None
    many: Callable | None = None
    peer: str = ''

    def run(self, frames):
        """Return the parameters of many frames, (N, K)."""
        return self.many(frames) if self.many else np.array([self.one(it) for it in frames])


def names_of(kind):
    """Return the names of the parameters of a kind of contact."""
    return POINT_NAMES if kind == 'point' else LINE_NAMES


def _contact(frame, estimator, layers, array, names):
    """Estimate the parameters of a frame, as the node does."""
    image = TactileImage(0, 0, tuple(
        replace(layer, stress=stress) for layer, stress in zip(layers, frame, strict=True)),
        array, tared=True)
    contact = estimator.estimate(image)
    return [getattr(contact, name) for name in names]


def _records(frames, estimator, layers, array, names):
    found = estimator.estimate_batch(frames, array, layers)
    offset = found['x'] * np.cos(found['yaw']) + found['y'] * np.sin(found['yaw'])
    return np.stack([offset if name == 'offset' else found[name] for name in names], axis=1)


def _estimator(name, arrays, *, known=True, **config):
    kind = arrays['kind']
    options = {'estimator': ContactEstimator(EstimatorConfig(**config)),
               'layers': layers_of(arrays, known=known), 'names': names_of(kind),
               'array': peer.POINT_ARRAY if kind == 'point' else peer.LINE_ARRAY}
    return Method(name, partial(_contact, **options), partial(_records, **options))


def methods(arrays, peers):
    """Return every method for the frames of a golden set."""
    kind, noise = arrays['kind'], float(arrays['noise'])
    found = [_estimator(FIT, arrays)]
    if len(arrays['depths']) == 1:
        found.append(_estimator('estimator, skin unknown', arrays, known=False))
    found += [_estimator(f'thesis: {name}', arrays, method=name)
              for name in ('compensated', 'moments') if kind == 'point' or name == 'moments']
    if len(arrays['depths']) > 1:
        return found
    if kind == 'point':
        found.append(Method('numpy Gauss-Newton', None, peer.numpy_gauss_newton))
        if 'cv2' in peers:
            found.append(Method('OpenCV moments + (2.3)', partial(
                peer.opencv_point, peers['cv2']), peer='cv2'))
        return found
    found.append(Method('Berger-Khosla', peer.berger_khosla))
    if 'cv2' in peers:
        found += [Method('OpenCV moments', partial(
            peer.opencv_line, peers['cv2'], noise_std=noise), peer='cv2'),
            Method('cv2.fitLine', partial(peer.opencv_fit_line, peers['cv2']), peer='cv2')]
    if 'skimage' in peers:
        found.append(Method('skimage orientation', partial(
            peer.skimage_orientation, importlib.import_module('skimage.measure')),
            peer='skimage'))
    return found
