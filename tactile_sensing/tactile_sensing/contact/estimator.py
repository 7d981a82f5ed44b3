"""Contact estimation: the least model that explains a tactile image, or an honest refusal."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from typing import Any

import numpy as np

from tactile_common.config import bounded, check_fields, one_of
from tactile_common.errors import ConfigurationError
from tactile_sensing.contact.extended_load import BEGINS, ENDS, PATCH
from tactile_sensing.contact.gauss_newton import LINE, POINT
from tactile_sensing.contact.methods import estimate_by_thesis, METHODS
from tactile_sensing.contact.parameters import forget_forces, widen_forces
from tactile_sensing.contact.pipeline import ANY_MODEL, estimate_frames, PENDING, RULES
from tactile_sensing.half_space.layers import Layer as FitLayer
from tactile_sensing.half_space.layers import Sensor, sensor_of
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import (
    COLUMNS,
    Contact,
    ContactType,
    ESTIMATE,
    INFORMATION,
    no_covariance,
    NOTHING,
    PARAMETERS,
    REALS,
    Reason,
    RECORD,
)
from tactile_sensing.types.image import Layer, TactileImage
from tactile_sensing.types.moments import Moments

MODELS = {'auto': ANY_MODEL, 'point': POINT, 'line': LINE}
TACTELS = {'point': 1, 'area': 3}  # Gauss points along each side that stand for a tactel

_MOMENTS = tuple(f.name for f in fields(Moments))
_ESTIMATED = ESTIMATE.names or ()
_INVALID = dict.fromkeys((*PARAMETERS, 'patch', 'start', 'end'), np.nan)


@dataclass(frozen=True)
class EstimatorConfig:
    """How contacts are estimated."""

    method: str = one_of(
        'fit', "'fit' (least squares, at the noise limit), or the closed forms of the thesis: "
        "'moments', or with the iteration of its section 2.4, 'compensated'", METHODS)
    model: str = one_of(
        'auto', "'auto' (the least model that explains the image), 'point' or 'line' alone",
        MODELS)
    tactel: str = one_of(
        'area', "a tactel measures the mean stress over its area ('area') or that at its centre "
        "('point')", TACTELS)
    fit_depth: bool = field(default=False, metadata={
        'doc': "find the tactels' depth from each image, near the one given; costs half of the "
               "force's accuracy (only 'fit')"})
    noise_std: float = bounded(
        0.0, 'standard deviation of one tactel; 0 = as the image says, or as its finest detail '
        'shows', 'Pa', 0.0, 1e9)
    min_snr: float = bounded(
        16.0, 'weaker contacts are reported but not valid', 'dB', 0.0, 100.0)
    model_error: float = bounded(
        0.07, 'what a model may leave out, as a fraction of its pressure', '', 0.0, 1.0)
    max_chi_square: float = bounded(
        2.0, 'chi-square per degree of freedom above which a model does not explain the image',
        '', 1.0, 1e6)

    def __post_init__(self):
        check_fields(self)
        if self.fit_depth and self.method != 'fit':
            raise ConfigurationError(f'fit_depth: the method {self.method!r} has no such choice')


class ContactEstimator:
    """Estimate the contact in one tactile image after the other; holds no state between them."""

    def __init__(self, config: EstimatorConfig | None = None):
        self.config = config = config or EstimatorConfig()
        self._rules = np.array([(
            config.min_snr, config.model_error, config.max_chi_square, 0.0, 0.0, config.fit_depth,
            MODELS[config.model], config.method == 'fit')], RULES)

    def estimate(self, image: TactileImage) -> Contact:
        """Estimate the contact of one image; what cannot be is not valid, with its reasons."""
        layers, array = image.layers, image.array
        main = next((layer for layer in layers if layer.component == 'zz'), None)
        if main is None or any(layer.stress.shape != array.shape or not is_possible(layer)
                               for layer in layers):
            return self.refuse_malformed()
        stress = np.array([[layer.stress for layer in layers]], dtype=np.float64)
        try:
            estimate = self._estimate(
                stress, array, layers, image.tared, image.saturated, main.unit == 'Pa')[0]
        except ConfigurationError:  # tactels that are far wider than they are deep
            return self.refuse_malformed()
        told: dict[str, Any] = dict(zip(_ESTIMATED, estimate.item(), strict=True))
        kind, reasons = ContactType(told.pop('type')), Reason(told.pop('reasons'))
        moments = Moments(*(told.pop(name) for name in _MOMENTS))
        valid, model = bool(_is_valid(kind, int(reasons))), ''
        shear, extras = told.pop('has_shear'), told.pop('extras')
        if valid:
            model = self._model_name(kind, shear, extras, layers)
        else:
            told.update(_INVALID, covariance=no_covariance())
        return Contact(kind, valid, reasons, self.config.method, model, moments=moments,
                       force_valid=valid and main.unit == 'Pa', **told)

    def estimate_batch(self, frames: np.ndarray, array: TactelArray, layers: Sequence[Layer], *,
                       tared: bool = True) -> np.ndarray:
        """
        Estimate the contact of many frames of one sensor.

        Parameters
        ----------
        frames : ndarray, shape (N, layers, rows, columns) or, of one layer, (N, rows, columns)
            Stress [Pa]; NaN marks invalid tactels.
        array : TactelArray
        layers : sequence of image.Layer
            Their stress is not read.
        tared : bool
            Whether the no-load picture has been subtracted.

        Returns
        -------
        ndarray of contact.RECORD, shape (N,)
            Every real number of a frame that is not valid is NaN, and forces and patch of one that
            is not force_valid.

        Raises
        ------
        ConfigurationError
            Frames of another shape, or layers without a 'zz' or with an impossible depth.
        """
        expected = (len(layers), *array.shape)
        stress = np.array(frames, dtype=np.float64)
        if stress.ndim == 3 and len(layers) == 1:
            stress = stress[:, None]
        if stress.ndim != 4 or stress.shape[1:] != expected:
            raise ConfigurationError(
                f'frames has the shape {np.shape(frames)}, must be (N, '
                f'{", ".join(map(str, expected))})')
        main = next((layer for layer in layers if layer.component == 'zz'), layers[0])
        estimates = self._estimate(stress, array, layers, tared, 0, main.unit == 'Pa')
        records = np.zeros(len(stress), RECORD)
        records['valid'] = valid = _is_valid(estimates['type'], estimates['reasons'])
        for name in COLUMNS:
            if name in _ESTIMATED:
                records[name] = estimates[name]
                if name == 'covariance' or name in REALS:
                    records[name][~valid] = np.nan
        records['force_valid'] = valid & (main.unit == 'Pa')
        records['moments'] = np.stack([estimates[name] for name in _MOMENTS], axis=-1)
        return records

    def refuse_malformed(self) -> Contact:
        """Return what is said of a picture that could not even be read."""
        return Contact(ContactType.NONE, False, Reason.BAD_IMAGE, self.config.method)

    def _estimate(self, stress, array, layers, tared, saturated, calibrated):
        """Estimates of frames, which are preprocessed in place: ESTIMATE records (N,)."""
        config, count = self.config, len(stress)
        plan = tuple((layer.component, layer.depth) for layer in layers)
        main = next(layer for layer in layers if layer.component == 'zz')
        sensor, table = _sensor(array, plan, TACTELS[config.tactel], main.thickness, main.poisson)
        table, rules = table.copy(), self._rules
        if main.gain_spread > 0.0 or main.force_std > 0.0:
            rules = rules.copy()
            rules['gain_spread'], rules['force_std'] = main.gain_spread, main.force_std
        table['given_noise'] = [config.noise_std or layer.noise_std for layer in layers]
        table['full_scale'] = [layer.full_scale for layer in layers]
        table['floor'] = [layer.floor for layer in layers]
        estimates = NOTHING.repeat(count)
        reasons = 0 if tared else int(Reason.NOT_TARED)
        step = count if config.method == 'fit' else 1  # the closed forms need a frame's noise
        for i in range(0, count, max(step, 1)):
            part = estimates[i:i + step]
            estimate_frames(stress[i:i + step], *sensor, table, rules, reasons, saturated,
                            calibrated, part)
            if part[0]['type'] == PENDING:
                measured = [replace(layer, noise_std=float(noise))
                            for layer, noise in zip(layers, table['noise'], strict=True)]
                _copy(estimate_by_thesis(config.method, stress[i], array, measured, config),
                      part[0])
                if not calibrated:
                    forget_forces.py_func(part.view(np.recarray)[0])
                else:
                    widen_forces.py_func(part.view(np.recarray)[0], main.force_std)
        return estimates

    def _model_name(self, kind, shear, extras, layers):
        names = '+'.join(layer.component for layer in layers
                         if kind == ContactType.POINT or layer.component == 'zz')
        return (kind.name.lower() + '+shear' * shear + '+patch' * bool(extras & PATCH)
                + '+ends' * bool(extras & (BEGINS | ENDS)) + '+depth' * self.config.fit_depth
                + '/' + names)


def _copy(contact, estimate):
    """Contact of the thesis into an ESTIMATE record."""
    estimate['type'], estimate['iterations'] = contact.type, contact.iterations
    estimate['reasons'] |= int(contact.reasons)
    estimate['has_shear'] = contact.type == ContactType.POINT
    for name in (*REALS, 'covariance'):
        estimate[name] = getattr(contact, name)


def is_possible(layer: Layer) -> bool:
    """Whether there is a skin with the numbers that come with a picture."""
    return (0.0 < layer.depth < np.inf and layer.thickness >= layer.depth
            and 0.0 <= layer.poisson <= 0.5 and 0.0 <= layer.gain_spread < 1.0
            and 0.0 <= layer.force_std < 1.0
            and (layer.component == 'zz' or layer.thickness == np.inf))


def _is_valid(kind, reasons):
    told = (kind == ContactType.POINT) | (kind == ContactType.LINE)
    return told & ((reasons & ~int(INFORMATION)) == 0)


@lru_cache(maxsize=64)
def _sensor(array: TactelArray, plan: tuple, tactel_points: int, thickness: float,
            poisson: float) -> tuple[Sensor, np.ndarray]:
    """Sensor and table of layers, with a noise of 1, see `sensor_of`."""
    return sensor_of(array, tuple(FitLayer(component, depth, 1.0) for component, depth in plan),
                     tactel_points, None, thickness, poisson)
