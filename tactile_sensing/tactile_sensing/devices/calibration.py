"""Calibration of one array: conversion of raw counts to pressure, and its YAML file."""
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
import math
from os import PathLike
from typing import Any

import numpy as np
import yaml

from tactile_common.atomic_file import replacing
from tactile_common.config import bounded, check_fields, one_of
from tactile_common.errors import ConfigurationError, naming
from tactile_common.yaml_file import mapping_of, read_yaml
from tactile_sensing.devices.counts import Counts
from tactile_sensing.devices.frame_clock import MAX_RATE
from tactile_sensing.devices.tare import (
    MIN_TARE_FRAMES,
    missing_mean,
    QUANTISATION,
    Tare,
    TareRefusedError,
    unloaded_statistics,
)
from tactile_sensing.types.array import PITCH, TactelArray
from tactile_sensing.types.image import COMPONENTS, Layer, SensorInfo
from tactile_sensing.types.skin import Skin

RESOLUTION = (1e-12, 1e12)
TOLERANCE = 5 / 255  # default tolerance of a tare [share of the range of the counts]
CHANCE = 5.0  # a mean may be off by this much by chance [standard deviations]
Convert = Callable[[np.ndarray], tuple[Layer, int]]


def _at_least_0(unit: str = '') -> Any:
    return bounded(0.0, unit=unit, low=0.0)


@dataclass(frozen=True, eq=False)
class Calibration:
    """
    Conversion of the counts of one array to an image, and known properties of its sensor.

    `gain` is the pressure per count [unit/count]. `baseline` is the counts of the unloaded pad,
    from the maker or an earlier tare. `gain`, `baseline` and `noise` are one number for all
    tactels, or one per tactel, `(rows, columns)`. With the unit 'counts' the gains are only known
    relative to each other, and there are no forces. Raises a ConfigurationError if a value is out
    of bounds.
    """

    array: TactelArray
    gain: np.ndarray = 1.0  # type: ignore[assignment]  # becomes an array
    unit: str = one_of('Pa', "or 'counts' if nothing is known", ('Pa', 'counts'))
    baseline: np.ndarray = 0.0  # type: ignore[assignment]
    noise: np.ndarray = 0.0  # type: ignore[assignment]  # standard deviation [counts]; 0 = unknown
    gain_spread: float = _at_least_0()  # relative standard deviation of true gains about `gain`
    # Relative standard deviation that all forces have in common, due to errors of gain and skin.
    force_std: float = _at_least_0()
    bits: int = 8  # this and the next three: see `Counts`
    signed: bool = False
    threshold: int | None = None
    saturation: int | None = None
    # Size of one count in the unit of frames in files, if that is not counts but e.g. V.
    resolution: float = bounded(1.0, '', '', *RESOLUTION)
    dead_tactels: tuple[int, ...] = ()  # row-major indices of tactels that are never used
    # Largest deviation of an unloaded tactel from `baseline` [counts]; 0: by TOLERANCE.
    tare_tolerance: float = _at_least_0()
    # For each row of the image, the index of the raw row; the same for columns. Empty: unchanged.
    row_order: tuple[int, ...] = ()
    column_order: tuple[int, ...] = ()
    transposed: bool = False  # whether the rows of the image are columns of the raw frames
    component: str = one_of('zz', 'of the stress', COMPONENTS)
    depth: float = bounded(0.0, 'of the tactels below the surface', 'm', 0.0, PITCH[1])
    thickness: float = _at_least_0('m')  # of the skin on a rigid backing; 0 = no backing near
    poisson: float = 0.5  # Poisson's ratio of the skin
    tactel: str = one_of('', 'what a tactel measures; empty: as the estimator is configured',
                         ('area', 'point', ''))
    skin_stiffness: float = _at_least_0('N/m^2')  # line force per indentation; 0 = unknown
    max_load: float = _at_least_0('N')  # largest normal force on the pad; 0 = unknown
    # Time from the middle of the acquisition to the arrival of the last byte.
    acquisition_delay: float = _at_least_0('s')
    # Images per second; 0 = unknown.
    nominal_rate: float = bounded(0.0, unit='Hz', low=0.0, high=MAX_RATE)
    model: str = 'flexitac'  # kind of device
    serial_number: str = ''
    source: str = ''  # origin of these values
    found: dict = field(default_factory=dict)  # how they were found, accuracy, assumptions

    def __post_init__(self) -> None:
        check_fields(self)
        if self.depth > 0.0:
            Skin(self.depth, self.thickness or math.inf, self.poisson)
        gain = self._per_tactel('gain')
        if not gain.min() > 0.0:
            raise ConfigurationError(f'gain is {gain.min()} at least once, must be above 0')
        baseline, counts = self._per_tactel('baseline'), self.counts
        if baseline.min() < counts.lowest or baseline.max() >= counts.saturation:
            raise ConfigurationError(
                f'baseline is {baseline.min()} to {baseline.max()}, must be at least '
                f'{counts.lowest} and below saturation = {counts.saturation}')
        noise = self._per_tactel('noise')
        if noise.min() < 0.0:
            raise ConfigurationError(f'noise is {noise.min()} at least once, must be at least 0')
        for name, size in (('row_order', self.array.rows), ('column_order', self.array.columns)):
            value = getattr(self, name)
            if value and sorted(value) != list(range(size)):
                raise ConfigurationError(
                    f'{name} is {value!r:.60}, must hold every integer from 0 to {size - 1} once')
        if not self.live.any():
            raise ConfigurationError('dead_tactels holds every tactel of the array')

    def _per_tactel(self, name: str) -> np.ndarray:
        """Replace a scalar or nested list by an array, shape `(rows, columns)`; return it."""
        try:
            given = np.asarray(getattr(self, name), dtype=np.float32)
        except (TypeError, ValueError, OverflowError):
            given = np.full(3, np.nan)
        if given.shape not in ((), self.array.shape) or not np.isfinite(given).all():
            raise ConfigurationError(
                f'{name} must be a number or {self.array.rows} rows of {self.array.columns} '
                'numbers, all finite')
        values = np.array(np.broadcast_to(given, self.array.shape))
        values.flags.writeable = False
        object.__setattr__(self, name, values)
        return values

    @cached_property
    def counts(self) -> Counts:
        """Range of the analogue-digital converter."""
        return Counts(self.bits, self.signed, self.threshold, self.saturation)

    @cached_property
    def live(self) -> np.ndarray:
        """Whether each tactel is used, (rows, columns)."""
        live = np.ones(self.array.rows * self.array.columns, bool)
        for index in self.dead_tactels:
            if not 0 <= index < live.size:
                raise ConfigurationError(
                    f'dead_tactels holds {index!r}, must be integers from 0 to {live.size - 1}')
            live[index] = False
        live.flags.writeable = False
        return live.reshape(self.array.shape)

    def arrange(self, frames: np.ndarray) -> np.ndarray:
        """Return raw frames (..., rows, columns) in the order of the image."""
        if self.transposed:
            frames = np.swapaxes(frames, -1, -2)
        if self.row_order:
            frames = frames[..., list(self.row_order), :]
        return frames[..., list(self.column_order)] if self.column_order else frames

    @property
    def raw_shape(self) -> tuple[int, int]:
        """Shape of a raw frame."""
        return self.array.shape[::-1] if self.transposed else self.array.shape

    @classmethod
    def uncalibrated(cls, rows: int, columns: int, pitch: Any, **values: Any) -> 'Calibration':
        """
        Return a calibration that leaves the counts unchanged.

        The pitch is one length, or two along x and y [m]. `values` are other fields of the class.
        The default depth of the tactels is the smaller pitch.
        """
        array = TactelArray(rows, columns, *pitch_pair(pitch))
        values = {'unit': 'counts', 'model': 'uncalibrated', 'source': 'none',
                  'depth': float(min(array.pitch_x, array.pitch_y)), **values}
        return cls(array, **values)

    def make_tare(self, frames: Sequence[np.ndarray] | np.ndarray,
                  before: Tare | None = None) -> Tare:
        """
        Average frames of the unloaded pad, raw counts `(n, rows, columns)`.

        A tactel counts as loaded if it differs from the baseline by more than the tolerance. With
        a tare `before`, it must not differ from that by more than the noise. Raises a
        TareRefusedError if there are too few frames, if a live tactel sends no number or is
        loaded, or if the frames are not steady.
        """
        frames = np.asarray(frames)
        if frames.ndim != 3 or frames.shape[1:] != self.raw_shape:
            raise TareRefusedError(
                f'frames have shape {frames.shape}, must be (n, {self.raw_shape[0]}, '
                f'{self.raw_shape[1]})')
        if len(frames) < MIN_TARE_FRAMES:
            raise TareRefusedError(f'{len(frames)} frames, at least {MIN_TARE_FRAMES} are needed')
        frames, counts, live = self.arrange(frames), self.counts, self.live
        sends = np.isfinite(frames).all(axis=0) | ~live
        if not sends.all():
            row, column = np.argwhere(~sends)[0]
            raise TareRefusedError(
                f'{np.count_nonzero(~sends)} tactels send no number, the first one is row {row} '
                f'column {column}: see dead_tactels')
        offset, noise = unloaded_statistics(frames, counts.threshold, counts.lowest, live)
        about, tolerance = self.baseline, self.tare_tolerance or TOLERANCE * (
            counts.highest - counts.lowest)
        if before is not None:
            about, tolerance = before.offset, before.noise_std
        # Median change from frame to frame: a load that begins does not count as noise.
        steps = np.abs(np.diff(frames[:, live].astype(np.float64), axis=0))
        chance = CHANCE * 1.05 * float(np.median(steps)) / np.sqrt(len(frames))
        deviation, allowed = np.where(live, offset - about, 0.0), tolerance + chance
        worst = np.unravel_index(np.abs(deviation).argmax(), deviation.shape)
        if abs(deviation[worst]) > allowed:
            loaded = np.count_nonzero(np.abs(deviation) > allowed)
            raise TareRefusedError(
                f'under load: {loaded} tactels are off the no-load baseline, row {worst[0]} '
                f'column {worst[1]} by {deviation[worst]:+.1f} counts, at most '
                f'{allowed:.1f} are allowed')
        half = len(frames) // 2
        change = np.where(live, frames[half:].mean(axis=0) - frames[:half].mean(axis=0), 0.0)
        allowed = 0.5 * tolerance + 2.0 * chance
        if np.abs(change).max() > allowed:
            raise TareRefusedError(
                f'not steady: a tactel changes by {np.abs(change).max():.1f} counts within '
                f'{len(frames)} frames, at most {allowed:.1f} are allowed')
        return Tare(offset.astype(np.float32), noise.astype(np.float32), live)

    def converter(self, tare: Tare | None = None) -> Convert:
        """
        Return the function that converts raw counts to a layer; without tare, by the baseline.

        It takes raw counts `(..., rows, columns)` and returns `(Layer, saturated)`: stress with
        NaN for dead and saturated tactels, and the number of saturated live tactels. A count below
        the threshold becomes the mean value of the noise below the threshold without load.
        Otherwise the sum over an unloaded image would not be 0.
        """
        offset, noise = self._unloaded(tare)
        zero = np.where(self.live, self.gain * offset, np.nan).astype(np.float32)
        noisy, template = self.live & (noise > 0.0), self.layer(tare)
        noise = np.where(noisy, noise, 1.0)
        level = (self.counts.threshold - 0.5 - offset) / noise
        below = (-self.gain * noise * missing_mean(level)).astype(np.float32)

        def convert(counts: np.ndarray) -> tuple[Layer, int]:
            counts = self.arrange(counts)
            stress = self.gain * counts - zero
            hidden, full = counts < self.counts.threshold, self.full(counts)
            if hidden.any():
                np.copyto(stress, below, where=noisy & hidden)
            if full.any():
                stress[full] = np.nan
            return replace(template, stress=stress), int(np.count_nonzero(full))

        return convert

    def full(self, counts: np.ndarray) -> np.ndarray:
        """Return which live tactels are at full scale, of arranged counts (..., rows, columns)."""
        return (counts >= self.counts.saturation) & self.live

    def stress(self, frames: np.ndarray, tare: Tare | None = None) -> np.ndarray:
        """Return the stress of raw frames (N, rows, columns), NaN as for `converter`."""
        return self.converter(tare)(np.asarray(frames, dtype=np.float64))[0].stress

    def _unloaded(self, tare: Tare | None) -> tuple[np.ndarray, np.ndarray]:
        """Return the counts of the unloaded tactels, and their noise; 0: unknown."""
        if tare is not None:
            return tare.offset, tare.noise
        return self.baseline, np.where(
            self.noise > 0.0, np.maximum(self.noise, QUANTISATION**0.5), 0.0)

    def layer(self, tare: Tare | None = None) -> Layer:
        """Return the layer without values: component, skin, unit, range and noise."""
        gain, (offset, noise) = self.gain[self.live], (
            values[self.live] for values in self._unloaded(tare))
        # Lowest full scale and highest floor of all live tactels.
        full_scale = (gain * (self.counts.saturation - offset)).min()
        floor = (gain * (self.counts.threshold - 0.5 - offset)).max()
        return Layer(
            self.component, self.depth, np.empty(0, np.float32), float(full_scale),
            float(np.sqrt(np.mean((gain * noise)**2))), self.unit, self.thickness or math.inf,
            self.poisson, self.gain_spread, float(floor) or 1e-9, self.force_std)

    def sensor_info(self, sensor: str, frame_id: str, stamp_ns: int, tare: Tare | None = None,
                    tared_at_ns: int = 0) -> SensorInfo:
        """Return the properties of the sensor that are published with its images."""
        return SensorInfo(
            stamp_ns=stamp_ns, frame_id=frame_id, sensor=sensor, model=self.model,
            serial_number=self.serial_number, array=self.array, nominal_rate=self.nominal_rate,
            acquisition_delay=self.acquisition_delay, skin_stiffness=self.skin_stiffness,
            max_load=self.max_load, layers=(self.layer(tare),), dead_tactels=self.dead_tactels,
            calibration=self.source, tared_at_ns=tared_at_ns)


def pitch_pair(pitch: Any) -> tuple[Any, Any]:
    """Return the pitch along x and along y, given one length or two [m]."""
    if not isinstance(pitch, (list, tuple)):
        return pitch, pitch
    if len(pitch) not in (1, 2):
        raise ConfigurationError(f'pitch is {pitch!r}, must be one length or two [m]')
    return pitch[0], pitch[-1]


_FIELDS = [item for item in fields(Calibration) if item.name not in ('array', 'source')]


def load_calibration(path: str | PathLike) -> Calibration:
    """
    Read a calibration file.

    The keys of the YAML file are the fields of `Calibration`, with two exceptions: the array is
    given by `rows`, `columns` and `pitch` ([m], one value or x and y), and `dead_tactels` are
    `[row, column]` pairs. Raises a ConfigurationError that names the file if a key is missing,
    unknown or out of bounds.
    """
    with naming(f'calibration {path}'):
        values = mapping_of(read_yaml(path), '', ('rows', 'columns', 'pitch', 'gain'),
                            [item.name for item in _FIELDS if item.name != 'gain'])
        array = TactelArray(values.pop('rows'), values.pop('columns'),
                            *pitch_pair(values.pop('pitch')))
        pairs, dead = values.pop('dead_tactels', None) or [], []
        for pair in pairs if isinstance(pairs, list) else [pairs]:
            if (not isinstance(pair, list) or [type(value) for value in pair] != [int, int]
                    or not (0 <= pair[0] < array.rows and 0 <= pair[1] < array.columns)):
                raise ConfigurationError(
                    f'dead_tactels holds {pair!r}, must be pairs [row, column] below '
                    f'[{array.rows}, {array.columns}]')
            dead.append(pair[0] * array.columns + pair[1])
        return Calibration(array, dead_tactels=tuple(dead), source=str(path), **values)


def save_calibration(calibration: Calibration, path: str | PathLike) -> None:
    """Write a file for `load_calibration`; raise a ConfigurationError if that fails."""
    array = calibration.array
    values: dict = {'rows': int(array.rows), 'columns': int(array.columns),
                    'pitch': [float(array.pitch_x), float(array.pitch_y)]}
    for item in _FIELDS:
        value, default = getattr(calibration, item.name), item.default
        if item.name not in ('gain', 'bits') and np.array_equal(value, default):  # type: ignore
            continue
        if isinstance(value, np.ndarray):  # five digits; one number if all are equal
            rows = [[float(f'{it:.5g}') for it in row] for row in value]
            value = rows[0][0] if len({it for row in rows for it in row}) == 1 else rows
        elif isinstance(value, (tuple, np.generic)):
            value = np.asarray(value).tolist()
        if item.name == 'dead_tactels':
            value = [list(divmod(index, values['columns'])) for index in value]
        values[item.name] = value
    text = yaml.safe_dump(values, sort_keys=False, width=99, default_flow_style=None)
    try:
        with replacing(path) as part:
            part.write_text('# Calibration of one array; `found` says how, how well, and what was '
                            f'assumed.\n{text}', encoding='utf-8')
    except OSError as error:
        raise ConfigurationError(f'calibration {path}: {error.strerror}') from error
