"""Contact estimation: the simplest load that explains a tactile image, or a refusal."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np

from tactile_common.config import bounded, check_fields, one_of
from tactile_common.errors import ConfigurationError
from tactile_sensing.contact.answer import answer, KnownSensor, MIN_SNR
from tactile_sensing.contact.fit import ENDS, PATCH, POWER
from tactile_sensing.contact.noise import noise_of_image
from tactile_sensing.skin.bumps import LINE, POINT
from tactile_sensing.skin.pad import pad_of
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import (
    Contact,
    ContactType,
    PARAMETERS,
    Reason,
    RECORD,
)
from tactile_sensing.types.image import COMPONENTS, Layer, TactileImage
from tactile_sensing.types.moments import Moments

# All but 'fit' are closed forms of the thesis; their module is loaded when one is chosen.
METHODS = ('fit', 'compensated', 'moments')
MODELS = {'auto': (POINT, LINE), 'point': (POINT,), 'line': (LINE,)}
TACTELS = ('point', 'area')
IMPOSSIBLE = 1e12  # [unit of the layer]; a larger value counts as no reading

_NOTHING = np.zeros(1, RECORD)
for _name in (*PARAMETERS, 'patch', 'start', 'end', 'covariance', 'snr', 'residual'):
    _NOTHING[_name] = np.nan


@dataclass(frozen=True)
class EstimatorConfig:
    """Configuration of a ContactEstimator; raises ConfigurationError for a bad value."""

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

    def __post_init__(self) -> None:
        check_fields(self)


class ContactEstimator:
    """Estimate the contact in a tactile image; keeps no state between images."""

    def __init__(self, config: EstimatorConfig | None = None):
        self.config = config or EstimatorConfig()

    def estimate(self, image: TactileImage) -> Contact:
        """Estimate the contact of one image; a refused image is not valid and has reasons."""
        layers, array = image.layers, image.array
        if not layers or any(layer.stress.shape != array.shape for layer in layers):
            return self.refuse_malformed()
        stress = np.array([[_floats(layer.stress) for layer in layers]])
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
        frames : ndarray, shape (N, layers, rows, columns); (N, rows, columns) for one layer
            Stress in the unit of the layers; NaN or masked: invalid tactel.
        array : TactelArray
        layers : sequence of image.Layer
            Their stress is not used. With a depth of 0 the skin is unknown and no forces result.
        tared : bool
            Whether the unloaded image has been subtracted.

        Returns
        -------
        ndarray of contact.RECORD, shape (N,)
            If a frame is not valid, all its real numbers except the moments are NaN. If it is not
            force_valid, its forces and patch are NaN.

        Raises
        ------
        ConfigurationError
            If the frames have a wrong shape, no layer is 'zz', or a layer has an impossible skin.
        """
        expected = (len(layers), *array.shape)
        stress = _floats(frames)
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
        """Return the contact for an image with wrong shape or impossible layers."""
        return Contact(ContactType.NONE, False, Reason.BAD_IMAGE, self.config.method)

    def _estimate(self, stress: np.ndarray, array: TactelArray, layers: Sequence[Layer],
                  tared: bool, saturated: int) -> tuple[np.ndarray, str]:
        """Return the records (N,) of frames and the last model's name."""
        for layer in layers:
            check_layer(layer)
        config = self.config
        main = next((k for k, it in enumerate(layers) if it.component == 'zz'), 0)
        order = [main, *(k for k in range(len(layers)) if k != main)]
        stress, layers = stress[:, order], [layers[k] for k in order]
        known = layers[0]
        pad = pad_of(
            array, tuple((layer.component, float(layer.depth)) for layer in layers),
            area=config.tactel == 'area', thickness=float(known.thickness),
            poisson=float(known.poisson))
        noises = np.array([max(config.noise_std or it.noise_std, 0.0) for it in layers], float)
        sensor = KnownSensor(
            pad, noises,
            np.array([it.full_scale or np.inf for it in layers]),
            np.array([it.floor or -np.inf for it in layers]), float(known.gain_spread),
            known.unit == 'Pa', float(known.force_std))
        stress[~(np.abs(stress) < IMPOSSIBLE)] = np.nan
        records, model = _NOTHING.repeat(len(stress)), ''
        fits = config.method == 'fit'
        kinds = np.array(MODELS[config.model] if fits else (), np.int64)
        options = answer(stress, (tuple(pad), *sensor[1:]), saturated, kinds, records)
        if not fits:
            thesis = import_module('tactile_sensing.thesis.closed_forms')
            for frame, record in zip(stress, records, strict=True):
                noisy = [replace(layer, noise_std=noise if noise > 0.0 else noise_of_image(
                    image, True)) for layer, image, noise in zip(
                        layers, frame, noises, strict=True)]
                thesis.write_record(frame, array, noisy, config, MIN_SNR, record)
        elif records['valid'][-1:].any():
            model = name_of(int(records['type'][-1]), options, layers)
        records['reasons'] |= int(Reason.UNCALIBRATED * (known.unit != 'Pa')
                                  | Reason.NOT_TARED * (not tared))
        records['moments'] *= array.pitch_x * array.pitch_y
        return records, model


def _floats(values: Any) -> np.ndarray:
    """Return a new array of floats; NaN where values are masked."""
    return np.ma.array(values, np.float64, copy=True, order='C').filled(np.nan)


def check_layer(layer: Layer) -> None:
    """Raise a ConfigurationError if no skin can have the values of a layer."""
    if layer.component not in COMPONENTS:
        raise ConfigurationError(
            f'component is {layer.component!r}, must be one of {", ".join(COMPONENTS)}')
    if not ((layer.depth == 0.0 or 1e-6 <= layer.depth <= 1.0) and layer.thickness >= layer.depth
            and 0.0 <= layer.poisson <= 0.5 and 0.0 <= layer.gain_spread < 1.0
            and 0.0 <= layer.force_std < 1.0
            and (layer.component == 'zz' or layer.thickness == np.inf)):
        raise ConfigurationError(
            f'depth {layer.depth!r}, thickness {layer.thickness!r}, poisson {layer.poisson!r}, '
            f'gain_spread {layer.gain_spread!r}, force_std {layer.force_std!r}: no such skin')


def name_of(kind: int, options: int, layers: Sequence[Layer]) -> str:
    """Return the name of a fitted model, such as 'line+width/zz'; `options`: see `beliefs_of`."""
    point = kind == ContactType.POINT
    components = '+'.join(it.component for it in layers if point or it.component == 'zz')
    return ('point' if point else 'line') + ''.join(
        f'+{name}' for name, bit in (('width', POWER), ('patch', PATCH), ('ends', ENDS))
        if options & bit) + f'/{components}'
