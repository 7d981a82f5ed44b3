"""Contact estimation: the least load that explains a tactile image, or an honest refusal."""

from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace
import math
from typing import Any

import numpy as np

from tactile_common.config import bounded, check_fields, one_of
from tactile_common.errors import ConfigurationError
from tactile_sensing.contact.hypotheses import (
    has_second_hill,
    Hypothesis,
    Image,
    LOUD,
    search,
)
from tactile_sensing.contact.methods import estimate_by_thesis, METHODS
from tactile_sensing.contact.noise import noise_of_image
from tactile_sensing.image import image_moments
from tactile_sensing.skin.bumps import (
    BEGIN,
    chord,
    END,
    FORCE,
    LINE,
    loaded_chord,
    Pad,
    POINT,
    Q0,
    Q1,
    SHEAR_U,
    SHEAR_V,
    WIDTH,
)
from tactile_sensing.skin.pad import pad_of
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import (
    COLUMNS,
    Contact,
    ContactType,
    FORCES,
    PARAMETERS,
    Reason,
    RECORD,
    ROW,
)
from tactile_sensing.types.image import Layer, TactileImage
from tactile_sensing.types.moments import Moments

MODELS = {'auto': (POINT, LINE), 'point': (POINT,), 'line': (LINE,)}
TACTELS = ('point', 'area')
FEWEST = 6  # tactels
LOADED, CUT_OFF = 0.3, 4  # of the peak; equal readings at the top that are cut off
DETECTION = 5.0  # standard deviations
IMPOSSIBLE = 1e12  # in the unit; a tactel that reports more, or no number, is not read
QUIETER = 0.9  # of the noise that an image seemed to have: worth another fit

_NOTHING = np.zeros(1, RECORD)
for _name in (*PARAMETERS, 'patch', 'start', 'end', 'covariance', 'snr', 'residual'):
    _NOTHING[_name] = np.nan


@dataclass(frozen=True)
class EstimatorConfig:
    """How contacts are estimated."""

    method: str = one_of(
        'fit', "'fit' (posterior mode, at the noise limit), or the closed forms of the thesis: "
        "'moments', or with the iteration of its section 2.4, 'compensated'", METHODS)
    model: str = one_of(
        'auto', "'auto' (the least model that explains the image), 'point' or 'line' alone",
        MODELS)
    tactel: str = one_of(
        'area', "a tactel measures the mean stress over its area ('area') or that at its centre "
        "('point')", TACTELS)
    noise_std: float = bounded(
        0.0, 'standard deviation of one tactel; 0 = as the image says, or as its finest detail '
        'shows', 'Pa', 0.0, 1e9)
    min_snr: float = bounded(
        16.0, 'weaker contacts are reported but not valid', 'dB', 0.0, 100.0)

    def __post_init__(self):
        check_fields(self)


class ContactEstimator:
    """Estimate the contact in one tactile image after the other; holds no state between them."""

    def __init__(self, config: EstimatorConfig | None = None):
        self.config = config or EstimatorConfig()

    def estimate(self, image: TactileImage) -> Contact:
        """Estimate the contact of one image; what cannot be is not valid, with its reasons."""
        layers, array = image.layers, image.array
        if not layers or any(layer.stress.shape != array.shape for layer in layers):
            return self.refuse_malformed()
        stress = np.array([[layer.stress for layer in layers]], dtype=np.float64)
        try:
            record, model = self._estimate(stress, array, layers, image.tared, image.saturated)
        except ConfigurationError:
            return self.refuse_malformed()
        told: dict[str, Any] = dict(zip(RECORD.names or (), record[0].item(), strict=True))
        told |= {'type': ContactType(told['type']), 'reasons': Reason(told['reasons']),
                 'covariance': record['covariance'][0],
                 'moments': Moments(*told['moments'].tolist())}
        return Contact(method=self.config.method, model=model, **told)

    def estimate_batch(self, frames: np.ndarray, array: TactelArray, layers: Sequence[Layer], *,
                       tared: bool = True) -> np.ndarray:
        """
        Estimate the contact of many frames of one sensor.

        Parameters
        ----------
        frames : ndarray, shape (N, layers, rows, columns) or, of one layer, (N, rows, columns)
            Stress in the layers' unit; NaN marks invalid tactels.
        array : TactelArray
        layers : sequence of image.Layer
            Their stress is not read. A depth of 0: the skin is not known, and there are no forces.
        tared : bool
            Whether the no-load image has been subtracted.

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
        records = self._estimate(stress, array, layers, tared, 0)[0]
        for name in ('snr', 'residual'):
            records[name][~records['valid']] = np.nan
        return records

    def refuse_malformed(self) -> Contact:
        """Return what is said of an image that could not even be read."""
        return Contact(ContactType.NONE, False, Reason.BAD_IMAGE, self.config.method)

    def _estimate(self, stress, array, layers, tared, saturated):
        """Records (N,) of frames, which are changed; model of the last."""
        for layer in layers:
            check_layer(layer)
        main = next((k for k, layer in enumerate(layers) if layer.component == 'zz'), 0)
        pad = pad_of(
            array, tuple((layer.component, float(layer.depth)) for layer in layers),
            area=self.config.tactel == 'area', thickness=float(layers[main].thickness),
            poisson=float(layers[main].poisson))
        records, model = _NOTHING.repeat(len(stress)), ''
        stress[~(np.abs(stress) < IMPOSSIBLE)] = np.nan
        for frame, record in zip(stress, records, strict=True):
            record['moments'] = astuple(image_moments(frame[main], array))
            model = self._estimate_one(frame, array, pad, layers, main, tared, saturated, record)
        return records, model

    def _estimate_one(self, frame, array, pad, layers, main, tared, saturated, record):
        """Write the record of one frame, without its moments; returns the model's name."""
        calibrated = layers[main].unit == 'Pa'
        full = np.array([[layer.full_scale or (
            hidden_scale(image) if layer.component == 'zz' else np.inf)]
                         for layer, image in zip(layers, frame, strict=True)])
        flat = frame.reshape(len(layers), -1)
        clipped = int((flat >= full).sum()) + saturated
        missing = int(np.isnan(flat).sum()) - saturated
        reasons = (Reason.SATURATED * (clipped > 0) | Reason.DEAD_TACTELS * (missing > 0)
                   | Reason.UNCALIBRATED * (not calibrated) | Reason.NOT_TARED * (not tared))
        told = [max(self.config.noise_std or layer.noise_std, 0.0) for layer in layers]
        noise = [std or noise_of_image(image, True)
                 for std, image in zip(told, frame, strict=True)]
        why = undetected(flat[main], noise[main], clipped > 0)
        if why:
            record['type'] = ContactType.NONE if clipped == 0 else ContactType.OTHER
            record['reasons'] = reasons | why
            return ''
        if self.config.method != 'fit':
            return self._by_thesis(frame, array, layers, main, noise, reasons, record)
        floor = np.array([[layer.floor or -np.inf] for layer in layers])
        tactels = np.ones(flat.shape)
        image = Image(pad, flat.ravel(), (tactels * np.square(noise)[:, None]).ravel(),
                      (tactels * full).ravel(), (tactels * floor).ravel(),
                      float(layers[main].gain_spread))
        if np.nanmax(flat[main]) < noise[main] * 10.0 ** (self.config.min_snr / 20.0):
            record['reasons'] = reasons | Reason.LOW_SNR  # whatever a fit would say
            return ''
        one, why = search(image, MODELS[self.config.model])
        if one and not told[main]:
            left = (flat.ravel() - one.fit.model).reshape(frame.shape)
            quieter = noise_of_image(left[main], False)
            if quieter < QUIETER * noise[main]:
                noise[main] = quieter
                image.noise2[:] = quieter ** 2
                one, why = search(image, MODELS[self.config.model])
        if why & Reason.BAD_FIT and has_second_hill(frame[main], noise[main]):
            why |= Reason.TWO_CONTACTS
        if one is None:
            record['type'], record['reasons'] = ContactType.OTHER, reasons | why
            return ''
        record['snr'] = 20.0 * math.log10(max(one.fit.model.max(), 1e-300) / noise[main])
        record['iterations'] = one.fit.iterations
        record['residual'] = one.misfit.residual
        if not why & ~Reason.SKIN_MISMATCH and record['snr'] < self.config.min_snr:
            why |= Reason.LOW_SNR
        valid = not why & ~Reason.SKIN_MISMATCH
        if valid and one.misfit.loudest > 2.0 * LOUD:
            reasons |= Reason.DEAD_TACTELS
        record['reasons'] = reasons | why
        record['type'] = type_of(one, why)
        record['valid'] = valid
        record['force_valid'] = forced = valid and calibrated and not one.power
        if not valid:
            return ''
        (write_point if one.kind == POINT else write_line)(pad, one, record)
        if not forced:
            forget_forces(record)
        elif layers[main].force_std > 0.0:
            widen_forces(record, layers[main].force_std)
        return name_of(one, layers)


    def _by_thesis(self, frame, array, layers, main, noise, reasons, record):
        """Write the record of one frame by a method of the thesis; returns the model's name."""
        frame = np.where(frame >= [[[layer.full_scale or np.inf]] for layer in layers], np.nan,
                         frame)
        known = [replace(layer, noise_std=std) for layer, std in zip(layers, noise, strict=True)]
        contact = estimate_by_thesis(self.config.method, frame, array, known, self.config)
        for name in COLUMNS:
            if name != 'moments':
                record[name] = getattr(contact, name)
        record['reasons'] |= int(reasons)
        record['force_valid'] = contact.valid and layers[main].unit == 'Pa'
        if not contact.valid:
            for name in (*PARAMETERS, 'patch', 'covariance'):
                record[name] = np.nan
        elif not record['force_valid']:
            forget_forces(record)
        elif layers[main].force_std > 0.0:
            widen_forces(record, layers[main].force_std)
        return contact.model


def check_layer(layer: Layer) -> None:
    """Raise a ConfigurationError where there is no skin with the numbers that come with it."""
    if not ((layer.depth == 0.0 or 1e-6 <= layer.depth <= 1.0) and layer.thickness >= layer.depth
            and 0.0 <= layer.poisson <= 0.5 and 0.0 <= layer.gain_spread < 1.0
            and 0.0 <= layer.force_std < 1.0
            and (layer.component == 'zz' or layer.thickness == np.inf)):
        raise ConfigurationError(
            f'depth {layer.depth!r}, thickness {layer.thickness!r}, poisson {layer.poisson!r}, '
            f'gain_spread {layer.gain_spread!r}, force_std {layer.force_std!r}: no such skin')


def hidden_scale(image: np.ndarray) -> float:
    """Full scale that nobody told, if readings show to be cut off; else infinite."""
    top = np.nanmax(image, initial=0.0)
    equal = np.count_nonzero(image == top)
    if not CUT_OFF <= equal <= 0.25 * image.size:
        return np.inf
    values, counts = np.unique(image[image > LOADED * top], return_counts=True)
    shows = len(values) > CUT_OFF and equal > 2 * counts[:-1].max()
    return float(top) if shows else np.inf


def undetected(pressure: np.ndarray, noise: float, clipped: bool) -> Reason:
    """Why nothing is to be fitted to the readings of one layer; Reason(0) if there is a load."""
    live = np.isfinite(pressure)
    count = np.count_nonzero(live)
    if count < FEWEST:
        return Reason.FEW_TACTELS
    if pressure[live].max() < DETECTION * noise and (
            pressure[live].sum() < DETECTION * noise * math.sqrt(count)):
        return Reason.BAD_FIT if clipped else Reason.NO_CONTACT
    return Reason(0)


def type_of(one: Hypothesis, why: Reason) -> ContactType:
    """Type that is reported of a hypothesis."""
    if why & (Reason.NO_CONTACT | Reason.LOW_SNR):
        return ContactType.NONE
    if why & (Reason.BAD_FIT | Reason.TWO_CONTACTS):
        return ContactType.OTHER
    return ContactType.POINT if one.kind == POINT else ContactType.LINE


def write_point(pad: Pad, one: Hypothesis, record: np.void) -> None:
    """Point into a record."""
    theta, rows = one.theta, [Q0, Q1, FORCE, SHEAR_U, SHEAR_V]
    names = [ROW.x, ROW.y, ROW.normal_force, ROW.shear_force_x, ROW.shear_force_y]
    for row, name in zip(rows, ('x', 'y', 'normal_force', 'shear_force_x', 'shear_force_y'),
                         strict=True):
        record[name] = theta[row]
    record['covariance'][np.ix_(names, names)] = one.covariance[np.ix_(rows, rows)]
    record['patch'] = pad.depths[0] * math.sqrt(5.0 * theta[WIDTH]) if one.has_patch else 0.0


def write_line(pad: Pad, one: Hypothesis, record: np.void) -> None:
    """Line into a record: the middle of what is loaded on the pad, and forces on the pad."""
    theta = one.theta
    rho, yaw, force, shear = theta[Q0], theta[Q1], theta[FORCE], theta[SHEAR_U]
    first, last, by_length = loaded_chord(pad, theta, one.has_ends)
    middle, length = 0.5 * (first + last), last - first
    cos, sin = math.cos(yaw), math.sin(yaw)
    record['x'], record['y'] = rho * cos - middle * sin, rho * sin + middle * cos
    turns = math.ceil(yaw / math.pi - 0.5)
    record['yaw'] = yaw - math.pi * turns
    record['normal_force'], record['line_force'] = force * length, force
    record['shear_force_x'] = shear * length * cos
    record['shear_force_y'] = shear * length * sin
    record['patch'] = 2.0 * pad.depths[0] * math.sqrt(theta[WIDTH]) if one.has_patch else 0.0
    if one.has_ends:
        begin, end = theta[BEGIN], theta[END]
        if turns % 2:
            begin, end = -end, -begin
        low, high = chord(pad, rho * (-1) ** turns, record['yaw'])
        record['start'] = begin if begin > low else np.nan
        record['end'] = end if end < high else np.nan
    rows = [Q0, Q1, BEGIN, END, FORCE, SHEAR_U]
    change = np.zeros((7, 6))  # of x, y, yaw, forces by the rows
    change[ROW.x, :2], change[ROW.y, :2] = (cos, cos * middle), (sin, sin * middle)
    change[ROW.yaw, 1] = 1.0
    change[ROW.normal_force] = *(force * by for by in by_length), length, 0.0
    change[ROW.line_force, 4] = 1.0
    change[ROW.shear_force_x] = *(shear * cos * by for by in by_length), 0.0, length * cos
    change[ROW.shear_force_y] = *(shear * sin * by for by in by_length), 0.0, length * sin
    change[ROW.shear_force_x, 1] -= shear * length * sin
    change[ROW.shear_force_y, 1] += shear * length * cos
    record['covariance'] = change @ one.covariance[np.ix_(rows, rows)] @ change.T


def forget_forces(record: np.void) -> None:
    """Make every force NaN, and its covariance."""
    for name in (*FORCES, 'patch'):
        record[name] = np.nan
    rows = [getattr(ROW, name) for name in FORCES]
    record['covariance'][rows] = record['covariance'][:, rows] = np.nan


def widen_forces(record: np.void, std: float) -> None:
    """Add to the covariance of forces what all of them are off by in common, as a share."""
    forces = np.array([record[name] for name in FORCES])
    rows = [getattr(ROW, name) for name in FORCES]
    record['covariance'][np.ix_(rows, rows)] += std ** 2 * np.outer(forces, forces)


def name_of(one: Hypothesis, layers: Sequence[Layer]) -> str:
    """Name of the model that was fitted."""
    components = '+'.join(layer.component for layer in layers
                          if one.kind == POINT or layer.component == 'zz')
    return ('point' if one.kind == POINT else 'line') + '+width' * one.power + (
        '+patch' * one.has_patch + '+ends' * one.has_ends + f'/{components}')
