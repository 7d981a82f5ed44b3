"""Contact estimation: the least load that explains a tactile image, or an honest refusal."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
import math
from typing import Any

import numpy as np

from tactile_common.config import bounded, check_fields, one_of
from tactile_common.errors import ConfigurationError
from tactile_sensing.contact.fit import Readings
from tactile_sensing.contact.hypotheses import Hypothesis, Image, search
from tactile_sensing.contact.methods import estimate_by_thesis, METHODS
from tactile_sensing.contact.misfit import LOUD
from tactile_sensing.contact.noise import noise_of_image
from tactile_sensing.contact.refusal import has_second_hill
from tactile_sensing.contact.reported import reported
from tactile_sensing.image import Survey, survey
from tactile_sensing.skin.bumps import LINE, Pad, POINT, WIDTH
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
# Equal readings at the top that may be cut off; steps of the converter to there, at least.
CUT_OFF, COARSE = 4, 30
LOADED, FINEST = 0.1, 1e-6  # of the peak: tactels that are looked at; resolution of readings
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
        fields: dict[str, Any] = dict(zip(RECORD.names or (), record[0].item(), strict=True))
        fields |= {'type': ContactType(fields['type']), 'reasons': Reason(fields['reasons']),
                 'covariance': record['covariance'][0],
                 'moments': Moments(*fields['moments'].tolist())}
        return Contact(method=self.config.method, model=model, **fields)

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
            model = self._estimate_one(frame, array, pad, layers, main, tared, saturated, record)
        records['moments'] *= array.pitch_x * array.pitch_y
        return records, model

    def _estimate_one(self, frame, array, pad, layers, main, tared, saturated, record):
        """Write the record of one frame; returns the model's name."""
        calibrated = layers[main].unit == 'Pa'
        full = np.array([layer.full_scale or np.inf for layer in layers])
        seen = survey(frame, main, full, pad)
        record['moments'] = seen.moments
        clipped, missing = seen.clipped + saturated, seen.missing - saturated
        given = [max(self.config.noise_std or layer.noise_std, 0.0) for layer in layers]
        noise = [std or noise_of_image(image, True)
                 for std, image in zip(given, frame, strict=True)]
        if full[main] == np.inf and CUT_OFF <= seen.highest <= 0.25 * frame[main].size:
            full[main] = hidden_scale(frame[main], noise[main])
            clipped += seen.highest * (full[main] < np.inf)
        reasons = (Reason.SATURATED * (clipped > 0) | Reason.DEAD_TACTELS * (missing > 0)
                   | Reason.UNCALIBRATED * (not calibrated) | Reason.NOT_TARED * (not tared))
        why = undetected(seen, noise[main], clipped > 0)
        if why:
            record['type'] = ContactType.NONE if clipped == 0 else ContactType.OTHER
            record['reasons'] = reasons | why
            return ''
        if self.config.method != 'fit':
            return self._by_thesis(frame, array, layers, main, noise, reasons, record)
        if seen.top < noise[main] * 10.0 ** (self.config.min_snr / 20.0):
            record['reasons'] = reasons | Reason.LOW_SNR  # whatever a fit would say
            return ''
        size, floor = frame[0].size, [layer.floor or -np.inf for layer in layers]
        readings = Readings(frame.ravel(), np.repeat(np.square(noise), size),
                            np.repeat(full, size), np.repeat(floor, size))
        image, kinds = Image(pad, readings, layers[main].gain_spread), MODELS[self.config.model]
        one, why = search(image, kinds)
        if one and not given[main]:
            left = (readings.value - one.model).reshape(frame.shape)
            quieter = noise_of_image(left[main], False)
            if quieter < QUIETER * noise[main]:
                noise[main] = quieter
                readings.noise2[:] = quieter ** 2
                one, why = search(image, kinds)
        if why & Reason.BAD_FIT and has_second_hill(frame[main], noise[main]):
            why |= Reason.TWO_CONTACTS
        if one is None:
            record['type'], record['reasons'] = ContactType.OTHER, reasons | why
            return ''
        record['snr'] = 20.0 * math.log10(max(one.model.max(), 1e-300) / noise[main])
        record['iterations'] = one.iterations
        record['residual'] = one.misfit.residual
        if not why & ~Reason.SKIN_MISMATCH and record['snr'] < self.config.min_snr:
            why |= Reason.LOW_SNR
        valid = not why & ~Reason.SKIN_MISMATCH
        if valid and (one.misfit.silent or one.misfit.loudest > 2.0 * LOUD):
            reasons |= Reason.DEAD_TACTELS
        record['reasons'] = reasons | why
        record['type'] = type_of(one, why)
        record['valid'] = valid
        record['force_valid'] = valid and calibrated and not one.power
        if not valid:
            return ''
        write(pad, one, record)
        grade_forces(record, layers[main].force_std)
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
        else:
            grade_forces(record, layers[main].force_std)
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


def hidden_scale(image: np.ndarray, noise: float) -> float:
    """Full scale where it is not known, if readings show to be cut off; else infinite."""
    top = float(np.nanmax(image))
    unit = FINEST * top
    values, counts = np.unique(np.rint(image[np.isfinite(image)] / unit), return_counts=True)
    steps, below, others = np.diff(values), values[:-1], counts[:-1]
    resolution = steps.min(initial=np.inf)
    if values[-1] < COARSE * resolution:  # rounding alone makes them equal
        return np.inf
    # Below a blunt top that is whole, noise and rounding leave as many as at it. Symmetry makes
    # others equal as well, where there is no noise.
    most = others[below >= values[-1] - 2.0 * max(noise / unit, resolution)].sum()
    if noise / unit <= np.median(steps):
        most = max(most, others[below > LOADED * values[-1]].max(initial=0))
    return top if counts[-1] > 2 * most else np.inf


def undetected(seen: Survey, noise: float, clipped: bool) -> Reason:
    """Why nothing is to be fitted to an image; Reason(0) if there is a load."""
    if seen.live < FEWEST:
        return Reason.FEW_TACTELS
    if seen.top < DETECTION * noise and (
            seen.total < DETECTION * noise * math.sqrt(seen.live)):
        return Reason.BAD_FIT if clipped else Reason.NO_CONTACT
    return Reason(0)


def type_of(one: Hypothesis, why: Reason) -> ContactType:
    """Type that is reported of a hypothesis."""
    if why & (Reason.NO_CONTACT | Reason.LOW_SNR):
        return ContactType.NONE
    if why & (Reason.BAD_FIT | Reason.TWO_CONTACTS):
        return ContactType.OTHER
    return ContactType.POINT if one.kind == POINT else ContactType.LINE


def write(pad: Pad, one: Hypothesis, record: np.void) -> None:
    """Load into a record."""
    values, covariance, start, end = reported(
        pad, one.kind, one.theta, one.has_ends, one.covariance)
    for name, value in zip(PARAMETERS, values.tolist(), strict=True):
        record[name] = value
    record['covariance'], record['start'], record['end'] = covariance, start, end
    spread = math.sqrt(one.theta[WIDTH]) if one.has_patch else 0.0
    record['patch'] = pad.depths[0] * spread * (math.sqrt(5.0) if one.kind == POINT else 2.0)


def grade_forces(record: np.void, std: float) -> None:
    """
    Make forces NaN that are not valid; widen the covariance of those that are.

    `std` is what all of them are off by in common, as a share.
    """
    rows = [getattr(ROW, name) for name in FORCES]
    if record['force_valid']:
        forces = np.array([record[name] for name in FORCES])
        record['covariance'][np.ix_(rows, rows)] += std ** 2 * np.outer(forces, forces)
        return
    for name in (*FORCES, 'patch'):
        record[name] = np.nan
    record['covariance'][rows] = record['covariance'][:, rows] = np.nan


def name_of(one: Hypothesis, layers: Sequence[Layer]) -> str:
    """Name of the model that was fitted."""
    components = '+'.join(layer.component for layer in layers
                          if one.kind == POINT or layer.component == 'zz')
    return ('point' if one.kind == POINT else 'line') + '+width' * one.power + (
        '+patch' * one.has_patch + '+ends' * one.has_ends + f'/{components}')
