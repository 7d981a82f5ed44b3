"""Contact estimation: the least model that explains a tactile image, or an honest refusal."""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.kernels import njit
from tactile_sensing.contact.gauss_newton import LINE, make_work, POINT
from tactile_sensing.contact.model_selection import DETECTION, explain, make_buffers
from tactile_sensing.contact.parameters import COUNT, HAS_SHEAR, SNR, VALUES
from tactile_sensing.contact.preprocessing import drop_unusable, noise_of, ridge_shape, survey
from tactile_sensing.half_space.layers import Layer as FitLayer
from tactile_sensing.half_space.layers import sensor_of
from tactile_sensing.half_space.point_model import peak
from tactile_sensing.moments.closed_forms import by_moments
from tactile_sensing.moments.image_moments import Moments
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact, ContactType, INFORMATION, Reason, RECORD
from tactile_sensing.types.image import Layer

METHODS = ('fit', 'compensated', 'moments')
MODELS = {'auto': (POINT, LINE), 'point': (POINT, POINT), 'line': (LINE, LINE)}
TACTELS = {'point': 1, 'area': 3}  # Gauss points along each side that stand for a tactel
MIN_TACTELS = 15  # live ones; three for each parameter of a point
LINE_LENGTH = 1.0  # standard deviation along the ridge [depths] that makes a line the first guess
CONTRADICTION = 1.5  # dB above min_snr that a second model needs to overrule a weak first

_REAL = ('a', 'b', 'yaw', 'P', 'Qx', 'Qy', 'line_force', 'snr', 'residual', 'force_windowed')
_PENDING = -1


@dataclass(frozen=True)
class EstimatorConfig:
    """How contacts are estimated."""

    method: str = field(default='fit', metadata={
        'doc': "'fit' (least squares, at the noise limit), or the closed forms of the thesis: "
               "'moments', or with the iteration of its section 2.4, 'compensated'"})
    model: str = field(default='auto', metadata={
        'doc': "'auto' (the least model that explains the image), 'point' or 'line' alone"})
    tactel: str = field(default='point', metadata={
        'doc': "a tactel measures the stress at its centre ('point') or the mean over its area "
               "('area')"})
    fit_depth: bool = field(default=False, metadata={
        'doc': "find the tactels' depth from each image, near the one given; costs half of the "
               "force's accuracy (only 'fit')"})
    noise_std: float = field(default=0.0, metadata={
        'doc': 'standard deviation of one tactel; 0 = as the image says, or as its finest '
               'detail shows', 'unit': 'Pa', 'range': (0.0, 1e9)})
    min_snr: float = field(default=16.0, metadata={
        'doc': 'weaker contacts are reported but not valid', 'unit': 'dB',
        'range': (0.0, 100.0)})
    model_error: float = field(default=0.07, metadata={
        'doc': 'what a model may leave out, as a fraction of its pressure',
        'range': (0.0, 1.0)})
    max_chi_square: float = field(default=2.0, metadata={
        'doc': 'chi-square per degree of freedom above which a model does not explain the image',
        'range': (1.0, 1e6)})

    def __post_init__(self):
        for name, known in (('method', METHODS), ('model', MODELS), ('tactel', TACTELS)):
            value = getattr(self, name)
            if value not in known:
                raise ConfigurationError(f'{name}: {value!r} is not one of {", ".join(known)}')
        for name, low, high in (('noise_std', 0.0, 1e9), ('min_snr', 0.0, 100.0),
                                ('model_error', 0.0, 1.0), ('max_chi_square', 1.0, 1e6)):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ConfigurationError(f'{name}: {value} is outside {low}..{high}')
        if self.fit_depth and self.method != 'fit':
            raise ConfigurationError(f'fit_depth: the method {self.method!r} has no such choice')


class ContactEstimator:
    """
    Estimate the contact in one tactile image after the other; holds no state between them.

    Parameters
    ----------
    config : EstimatorConfig, optional
    """

    def __init__(self, config=None):
        self.config = config or EstimatorConfig()
        # Loads or compiles the kernels now, not under the first picture.
        array = TactelArray(8, 8, 1e-3, 1e-3)
        self.estimate_batch(np.zeros((1, *array.shape)), array, (Layer('zz', 1e-3, None),))

    def estimate(self, image):
        """
        Estimate the contact of one image.

        Parameters
        ----------
        image : TactileImage

        Returns
        -------
        Contact
            Always: what cannot be estimated is not valid, with its reasons.
        """
        layers, array = image.layers, image.array
        main = next((layer for layer in layers if layer.component == 'zz'), None)
        if main is None or any(layer.stress.shape != array.shape or not 0.0 < layer.depth < np.inf
                               for layer in layers):
            return self.refuse_malformed()
        stress = np.array([[layer.stress for layer in layers]], dtype=np.float64)
        verdicts, values, covariance, moments = self._estimate(
            stress, array, layers, image.tared, image.saturated, main.unit == 'Pa')
        kind, reasons = ContactType(int(verdicts[0, 0])), Reason(int(verdicts[0, 1]))
        valid = _is_valid(kind, int(reasons))
        number = values[0].tolist()
        if not valid:
            number[:7] = [np.nan] * 7
            covariance[0] = np.nan
        model = self._model_name(kind, number, layers) if valid else ''
        return Contact(
            kind, valid, reasons, self.config.method, model, *number[:7], covariance[0],
            *number[7:9], int(number[COUNT]), number[9], Moments(*moments[0].tolist()))

    def estimate_batch(self, frames, array, layers, *, tared=True):
        """
        Estimate the contact of many frames of one sensor.

        Parameters
        ----------
        frames : ndarray, shape (N, layers, rows, columns) or, of one layer, (N, rows, columns)
            Stress [Pa]; NaN marks invalid tactels.
        array : TactelArray
            Geometry of the tactels.
        layers : sequence of image.Layer
            Component, depth, full scale and noise of each; their stress is not read.
        tared : bool
            Whether the no-load picture has been subtracted.

        Returns
        -------
        ndarray of contact.RECORD, shape (N,)
            Every real number of a frame that is not valid is NaN.

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
        verdicts, values, covariance, _ = self._estimate(stress, array, layers, tared, 0, True)
        records = np.zeros(len(stress), RECORD)
        records['type'], records['flags'] = verdicts.T
        records['valid'] = _is_valid(verdicts[:, 0], verdicts[:, 1])
        for name, column in zip(_REAL, values.T, strict=False):
            records[name] = column
        records['covariance'] = covariance
        records['iterations'] = values[:, COUNT]
        lost = ~records['valid']
        for name in (*_REAL, 'covariance'):
            records[name][lost] = np.nan
        return records

    def refuse_malformed(self):
        """Return what is said of a picture that could not even be read."""
        return Contact(ContactType.NONE, False, Reason.BAD_IMAGE, self.config.method)

    def _estimate(self, stress, array, layers, tared, saturated, calibrated):
        """Type and reasons (N, 2), values, covariance and moments of conditioned frames."""
        config, count = self.config, len(stress)
        given = np.array([config.noise_std or layer.noise_std for layer in layers], dtype=float)
        full_scale = np.array([layer.full_scale for layer in layers], dtype=float)
        sensor, table = _sensor(array, tuple((layer.component, layer.depth) for layer in layers),
                                TACTELS[config.tactel])
        verdicts = np.zeros((count, 2), dtype=np.int64)
        values = np.full((count, VALUES), np.nan)
        values[:, COUNT] = 0.0
        covariance = np.full((count, 7, 7), np.nan)
        moments = np.empty((count, 6))
        noise = np.empty((count, len(layers)))
        _estimate_frames(
            stress, sensor, table, given, full_scale,
            (config.min_snr, config.model_error, config.max_chi_square, config.fit_depth),
            MODELS[config.model], config.method == 'fit', calibrated,
            (0 if tared else int(Reason.NOT_TARED), saturated), verdicts, values, covariance,
            moments, noise)
        for i in np.flatnonzero(verdicts[:, 0] == _PENDING):
            kind, reasons = by_moments(stress[i], array, table, sensor[4], noise[i], config,
                                       values[i], covariance[i])
            verdicts[i] = kind, reasons | verdicts[i, 1]
        return verdicts, values, covariance, moments

    def _model_name(self, kind, number, layers):
        names = '+'.join(layer.component for layer in layers
                         if kind == ContactType.POINT or layer.component == 'zz')
        return (kind.name.lower() + '+shear' * (number[HAS_SHEAR] > 0.0)
                + '+depth' * self.config.fit_depth + '/' + names)


def _is_valid(kind, reasons):
    told = (kind == ContactType.POINT) | (kind == ContactType.LINE)
    return told & ((reasons & ~int(INFORMATION)) == 0)


@lru_cache(maxsize=64)
def _sensor(array, plan, tactel_points):
    """Sensor and table of layers, with a noise of 1, see `sensor_of`."""
    return sensor_of(array, tuple(FitLayer(component, depth, 1.0) for component, depth in plan),
                     tactel_points)


_NONE, _OTHER = int(ContactType.NONE), int(ContactType.OTHER)
_NO_CONTACT, _LOW_SNR = int(Reason.NO_CONTACT), int(Reason.LOW_SNR)
_BAD_FIT, _BAD_IMAGE = int(Reason.BAD_FIT), int(Reason.BAD_IMAGE)
_FEW, _SATURATED, _DEAD = (
    int(Reason.FEW_TACTELS), int(Reason.SATURATED), int(Reason.DEAD_TACTELS))


@njit(error_model='numpy')
def _condition(stress, sensor, layers, given, full_scale, calibrated, left_out, moments):
    """Make a frame ready, in place; returns type, or _PENDING, and reasons."""
    reasons, saturated = left_out
    x, y, pitch_x, pitch_y, component, _, _ = sensor
    missing, at_full_scale, main = 0, 0, -1
    for k in range(stress.shape[0]):
        gone, full, threshold = drop_unusable(stress[k], full_scale[k], component[k] != 0)
        layers[k, 1], layers[k, 5] = noise_of(stress[k], given[k], threshold), threshold
        missing += gone
        at_full_scale += full
        if main < 0 and component[k] == 0:
            main = k
    if at_full_scale > 0 or (missing > 0 and saturated > 0):
        reasons |= _SATURATED
    if missing > saturated:
        reasons |= _DEAD
    live, highest = survey(stress[main], x, y, pitch_x * pitch_y, moments)
    if not calibrated:  # no force can be told, so nothing is called a contact estimate
        return (_OTHER if moments[0] > 0.0 else _NONE), reasons | _BAD_IMAGE
    if live < MIN_TACTELS:
        if live == 0:
            moments[:] = np.nan
        return _NONE, reasons | _FEW
    noise, total = layers[main, 1], moments[0] / (pitch_x * pitch_y)
    if highest < DETECTION * noise and total < DETECTION * noise * np.sqrt(live):
        if at_full_scale + saturated > 0:  # the loaded tactels are the ones that are missing
            return _OTHER, reasons | _BAD_FIT
        return _NONE, reasons | _NO_CONTACT
    return _PENDING, reasons


@njit(error_model='numpy')
def _likelier(stress, sensor, layers):
    """The model to try first: how far the tactels above half the peak spread."""
    layer, row, column = peak(stress, sensor[4], layers[:, 1])
    if layer < 0:
        return POINT
    image = stress[layer]
    spread, elongation = ridge_shape(image, sensor[0], sensor[1], 0.5 * image[row, column])
    is_long = spread > (LINE_LENGTH * layers[layer, 0]) ** 2 and not elongation < 2.0
    return LINE if is_long else POINT


@njit(cache=True, error_model='numpy')
def _estimate_frames(stress, sensor, table, given, full_scale, rules, models, fit, calibrated,
                    left_out, verdicts, values, covariance, moments, noise):
    """Estimate every frame of stress (N, layers, rows, columns), conditioned in place."""
    frames, count, rows, columns = stress.shape
    work = make_work(count, count * rows * columns, sensor[5].shape[0])
    buffers = make_buffers(count, rows, columns)
    layers = table.copy()
    second_values, second_covariance = np.empty(VALUES), np.empty((7, 7))
    for f in range(frames):
        kind, reasons = _condition(
            stress[f], sensor, layers, given, full_scale, calibrated, left_out, moments[f])
        for k in range(count):
            noise[f, k] = layers[k, 1]
        verdicts[f, 0], verdicts[f, 1] = kind, reasons
        if kind != _PENDING or not fit:
            continue
        first = models[0]
        if models[0] != models[1]:
            first = _likelier(stress[f], sensor, layers)
        kind, why = explain(first, stress[f], sensor, layers, rules, buffers, work, values[f],
                            covariance[f])
        if why & (_BAD_FIT | _LOW_SNR) and models[0] != models[1]:
            second_values[:] = np.nan
            second_values[COUNT] = 0.0
            second_covariance[:] = np.nan
            other, other_why = explain(
                POINT + LINE - first, stress[f], sensor, layers, rules, buffers, work,
                second_values, second_covariance)
            unclear = other_why & (_BAD_FIT | _LOW_SNR)
            weak = why & _LOW_SNR
            # Where the likelier model is too weak, the other may contradict it, if it is
            # strong enough to, but not convince.
            if not weak or (
                    unclear and second_values[SNR] >= rules[0] + CONTRADICTION):
                kind, why = other, other_why | (_LOW_SNR if weak else 0)
                for i in range(VALUES):
                    values[f, i] = second_values[i]
                for i in range(49):
                    covariance[f].flat[i] = second_covariance.flat[i]
        verdicts[f, 0], verdicts[f, 1] = kind, reasons | why
