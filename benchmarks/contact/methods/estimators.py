"""Estimators that the contact benchmark compares: ours, the thesis', and their peers."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
import importlib

import numpy as np

from benchmarks.contact.cases.loads import (
    layers_of,
    LINE_ARRAY,
    LINE_NAMES,
    POINT_ARRAY,
    POINT_NAMES,
)
from benchmarks.contact.methods import peers as peer
from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.contact.load_fits import fit_loads
from tactile_sensing.image import image_moments
from tactile_sensing.thesis.compensation import compensated
from tactile_sensing.thesis.line_moments import line_from_moments
from tactile_sensing.thesis.point_moments import basic, MomentFlag
from tactile_sensing.types.contact import ContactType, line_offsets
from tactile_sensing.types.image import Layer, TactileImage

REFUSED = (MomentFlag.NO_FORCE | MomentFlag.SINGULAR | MomentFlag.OFF_PAD
           | MomentFlag.NOT_CONVERGED)


@dataclass(frozen=True)
class Method:
    """
    One way to estimate a contact.

    estimate(frame) returns the parameters, NaN where it does not give one or refuses;
    batch(frames) those of many frames; peer is the module of another library.
    """

    name: str
    kind: str
    estimate: Callable | None
    batch: Callable | None = None
    peer: str = ''
    model: int = 1

    @property
    def label(self):
        """Name with the sensing structure."""
        return f'{self.name}, model {self.model}' if self.kind == 'point' else self.name

    def run(self, frames):
        """Parameters of many frames, (N, K)."""
        if self.batch:
            return self.batch(frames)
        return np.array([self.estimate(frame) for frame in frames])


# ----------------------------------------------------------------- the whole estimator

def _contact(frame, estimator, layers, array, names):
    """From a picture to the parameters, named as in a record, as the node does."""
    contact = estimator.estimate(TactileImage(0, 0, tuple(
        Layer(layer.component, layer.depth, stress, noise_std=layer.noise_std)
        for layer, stress in zip(layers, frame, strict=True)), array, tared=True))
    return [getattr(contact, name) for name in names]


def _records(frames, estimator, layers, array, names):
    found = estimator.estimate_batch(frames, array, [
        Layer(layer.component, layer.depth, None, noise_std=layer.noise_std)
        for layer in layers])
    return np.stack([line_offsets(found) if name == 'offset' else found[name] for name in names],
                    axis=1)


def _estimator(kind, method, layers, model=1):
    """Method of the whole estimator with the choice of model."""
    estimator = ContactEstimator(EstimatorConfig(method=method, tactel='point'))
    options = {'estimator': estimator, 'layers': layers}
    name = f'estimator, {method}'
    array, names = (POINT_ARRAY, POINT_NAMES) if kind == 'point' else (LINE_ARRAY, LINE_NAMES)
    one = partial(_contact, array=array, names=names, **options)
    many = partial(_records, array=array, names=names, **options)
    if kind == 'line':  # whose frames have no axis of layers
        return Method(name, kind, lambda frame: one(frame[None]), many)
    return Method(name, kind, one, many, model=model)


# --------------------------------------------------------------------------- its parts

def _fit_points(frames, layers):
    fit = fit_loads(ContactType.POINT, frames, POINT_ARRAY, layers)
    return np.where(fit['converged'][:, None], fit['vector'], np.nan)


def _fit_lines(images, layers):
    fit = fit_loads(ContactType.LINE, images[:, None], LINE_ARRAY, layers, shear=False)
    found = np.column_stack([fit['rho'], fit['yaw'], fit['force']])
    return np.where(fit['converged'][:, None], found, np.nan)


def _one(many):
    """One frame at a time by a function of many."""
    return lambda frame: many(frame[None])[0]


def _closed_form(frame, layers, function, **options):
    return _moment_parameters(function(frame, POINT_ARRAY, layers, **options))


def _moment_parameters(found):
    if found.flags & REFUSED:
        return [np.nan] * 5
    return [found.a, found.b, found.normal_force, found.shear_force_x, found.shear_force_y]


def fit_method(model, noise_std):
    """The bare fit of a point."""
    many = partial(_fit_points, layers=layers_of(model, noise_std))
    return Method('fit', 'point', _one(many), many, model=model)


def closed_forms(model, noise_std):
    """The thesis' closed forms of a point."""
    layers = layers_of(model, noise_std)
    found = [Method(name, 'point', partial(_closed_form, layers=layers, function=function),
                    model=model)
             for name, function in (('compensated', compensated), ('basic', basic))]
    if model == 3:
        found.append(Method('compensated as printed', 'point', partial(
            _closed_form, layers=layers, function=compensated, printed=True), model=3))
    return found


def point_methods(model, noise_std, peers):
    """Every method for a point, for frames of this noise [Pa]."""
    layers = layers_of(model, noise_std)
    methods = [fit_method(model, noise_std), *closed_forms(model, noise_std),
               _estimator('point', 'fit', layers, model)]
    if model > 1:
        return methods
    methods += [_estimator('point', name, layers) for name in ('compensated', 'moments')]
    methods.append(Method('numpy Gauss-Newton', 'point', None, peer.numpy_gauss_newton))
    methods.append(Method('tuned numpy Gauss-Newton', 'point', None, peer.tuned_gauss_newton))
    if 'cv2' in peers:
        methods.append(Method('OpenCV moments + (2.3)', 'point', lambda frame: (
            _moment_parameters(peer.opencv_point(peers['cv2'], frame[0]))), peer='cv2'))
    return methods


def _line_moments(image, noise_std, printed):
    # The thesis' only preprocessing (3.5): a threshold of four times the noise.
    moments = image_moments(image, LINE_ARRAY, threshold=4.0 * noise_std)
    found = line_from_moments(moments, LINE_ARRAY.half_width_y, printed=printed)
    return [found.a * np.cos(found.yaw), found.yaw, found.line_force]


def line_fit_method(noise_std):
    """The bare fit of a line."""
    many = partial(_fit_lines, layers=layers_of(1, noise_std))
    return Method('fit', 'line', _one(many), many)


def line_methods(noise_std, peers):
    """Every method for a line, for frames of this noise [Pa]."""
    layers = layers_of(1, noise_std)
    methods = [
        line_fit_method(noise_std),
        Method('moments', 'line', partial(_line_moments, noise_std=noise_std, printed=False)),
        Method('moments as printed', 'line', partial(
            _line_moments, noise_std=noise_std, printed=True)),
        *(_estimator('line', name, layers) for name in ('fit', 'moments')),
        Method('Berger-Khosla', 'line', peer.berger_khosla)]
    if 'cv2' in peers:
        methods += [
            Method('OpenCV moments', 'line', partial(
                peer.opencv_line, peers['cv2'], noise_std=noise_std), peer='cv2'),
            Method('cv2.fitLine', 'line', partial(
                peer.opencv_fit_line, peers['cv2']), peer='cv2')]
    if 'skimage' in peers:
        measure = importlib.import_module('skimage.measure')
        methods.append(Method('skimage orientation', 'line', partial(
            peer.skimage_orientation, measure), peer='skimage'))
    return methods
