"""From raw counts to pressure: calibration file, tare, invalid tactels."""
from dataclasses import dataclass, field, fields
import math

import numpy as np

from tactile_common.config import checked
from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.yaml_file import read_yaml
from tactile_sensing.types.array import PITCH, TactelArray
from tactile_sensing.types.image import COMPONENTS, Layer, SensorInfo

UNITS = ('Pa', 'counts')
# Fewer frames tell neither the noise nor whether the picture is steady.
MIN_TARE_FRAMES = 20
CHANCE = 5.0  # standard deviations that a mean may be off by chance


class TareRefusedError(TactileError):
    """The frames are no picture of the unloaded pad; the message says why."""


@dataclass(frozen=True, eq=False)
class Tare:
    """Picture of the unloaded pad."""

    offset: np.ndarray  # mean counts, shape (rows, columns), float32
    noise_std: float  # standard deviation of one tactel from frame to frame [counts]


@dataclass(frozen=True, eq=False)
class Calibration:
    """
    What turns the counts of one array into a picture, and what is known of its sensor.

    `gain`, pressure per count [unit/count], and `baseline`, the counts of the unloaded pad as the
    maker or an earlier tare found them, are given for all tactels or one each, `(rows, columns)`.
    Raises a ConfigurationError where a value is out of bounds.
    """

    array: TactelArray
    gain: np.ndarray = 1.0  # type: ignore[assignment]  # becomes an array
    unit: str = 'Pa'  # or 'counts' if nothing is known
    baseline: np.ndarray = 0.0  # type: ignore[assignment]
    saturation: int = 255  # counts from which on a tactel is at full scale, its value unknown
    dead_tactels: tuple = ()  # row-major indices of tactels that are never used
    tare_tolerance: float = 5.0  # of an unloaded tactel, from `baseline` [counts]; more is a load
    component: str = 'zz'  # of the stress
    depth: float = 0.0  # of the tactels below the surface of the skin [m]
    skin_stiffness: float = 0.0  # line force per length and indentation [N/m^2]; 0 = unknown
    max_load: float = 0.0  # largest normal force on the pad [N]; 0 = unknown
    acquisition_delay: float = 0.0  # from its middle to the arrival of the last byte [s]
    nominal_rate: float = 0.0  # pictures per second [Hz]; 0 = unknown
    model: str = 'flexitac'  # kind of device
    serial_number: str = ''
    source: str = ''  # where these values come from
    live: np.ndarray = field(init=False, repr=False)  # (rows, columns): whether a tactel is used

    def __post_init__(self):
        checked('depth', self.depth, float, {'range': (0.0, PITCH[1]), 'unit': 'm'})
        for name in ('tare_tolerance', 'depth', 'skin_stiffness', 'max_load',
                     'acquisition_delay', 'nominal_rate'):
            value = getattr(self, name)
            if not _is_number(value) or not 0.0 <= value < math.inf:
                raise ConfigurationError(f'{name} is {value!r}, must be a number of at least 0')
        for name, choices in (('unit', UNITS), ('component', COMPONENTS)):
            value = getattr(self, name)
            if value not in choices:
                raise ConfigurationError(f'{name} is {value!r}, must be one of {choices}')
        for name in ('model', 'serial_number', 'source'):
            if not isinstance(getattr(self, name), str):
                raise ConfigurationError(f'{name} is {getattr(self, name)!r}, must be a text')
        if type(self.saturation) is not int or not 1 <= self.saturation <= 256:
            raise ConfigurationError(
                f'saturation is {self.saturation!r}, must be an integer from 1 to 256')
        gain = self._per_tactel('gain')
        if not gain.min() > 0.0:
            raise ConfigurationError(f'gain is {gain.min()} at least once, must be above 0')
        baseline = self._per_tactel('baseline')
        if baseline.min() < 0.0 or baseline.max() >= self.saturation:
            raise ConfigurationError(
                f'baseline is {baseline.min()} to {baseline.max()}, must be at least 0 and '
                f'below saturation = {self.saturation}')
        object.__setattr__(self, 'live', self._live())

    def _per_tactel(self, name):
        """Replace a scalar or nested list by an array, shape `(rows, columns)`."""
        try:
            given = np.asarray(getattr(self, name), dtype=np.float32)
        except (TypeError, ValueError):
            given = np.full(3, np.nan)
        if given.shape not in ((), self.array.shape) or not np.isfinite(given).all():
            raise ConfigurationError(
                f'{name} must be a number or {self.array.rows} rows of {self.array.columns} '
                'numbers, all finite')
        values = np.array(np.broadcast_to(given, self.array.shape))
        values.flags.writeable = False
        object.__setattr__(self, name, values)
        return values

    def _live(self):
        live = np.ones(self.array.rows * self.array.columns, bool)
        for index in self.dead_tactels:
            if type(index) is not int or not 0 <= index < live.size:
                raise ConfigurationError(
                    f'dead_tactels holds {index!r}, must be integers from 0 to {live.size - 1}')
            live[index] = False
        if not live.any():
            raise ConfigurationError('dead_tactels holds every tactel of the array')
        live.flags.writeable = False
        return live.reshape(self.array.shape)

    @classmethod
    def uncalibrated(cls, rows: int, columns: int, pitch, **values) -> 'Calibration':
        """
        Return a calibration that passes the counts through.

        The pitch is one length or two, along x and y [m]; values are other fields of the class.
        """
        pitch_x, pitch_y = _pair(pitch)
        values = {'unit': 'counts', 'model': 'uncalibrated', 'source': 'none', **values}
        return cls(TactelArray(rows, columns, pitch_x, pitch_y), **values)

    def make_tare(self, frames) -> Tare:
        """
        Average frames of the unloaded pad, raw counts `(n, rows, columns)`.

        Raises
        ------
        TareRefusedError
            Too few frames, a load on a live tactel, or a picture that moves.
        """
        frames = np.asarray(frames)
        if frames.ndim != 3 or frames.shape[1:] != self.array.shape:
            raise TareRefusedError(
                f'frames have shape {frames.shape}, must be (n, {self.array.rows}, '
                f'{self.array.columns})')
        if len(frames) < MIN_TARE_FRAMES:
            raise TareRefusedError(f'{len(frames)} frames, at least {MIN_TARE_FRAMES} are needed')
        offset = frames.mean(axis=0, dtype=np.float64)
        noise_std = float(np.sqrt(frames.var(axis=0, ddof=1, dtype=np.float64)[self.live].mean()))
        # From frame to frame, and by the median, so that a load that comes is no noise.
        steps = np.abs(np.diff(frames[:, self.live].astype(np.float64), axis=0))
        chance = CHANCE * 1.05 * float(np.median(steps)) / np.sqrt(len(frames))  # of a mean
        self._refuse_load(np.where(self.live, offset - self.baseline, 0.0), chance)
        half = len(frames) // 2
        change = np.where(self.live, frames[half:].mean(axis=0) - frames[:half].mean(axis=0), 0.0)
        allowed = 0.5 * self.tare_tolerance + 2.0 * chance
        if np.abs(change).max() > allowed:
            raise TareRefusedError(
                f'not steady: a tactel changes by {np.abs(change).max():.1f} counts within '
                f'{len(frames)} frames, at most {allowed:.1f} are allowed')
        return Tare(offset.astype(np.float32), noise_std)

    def _refuse_load(self, deviation, chance):
        worst = np.unravel_index(np.abs(deviation).argmax(), deviation.shape)
        allowed = self.tare_tolerance + chance
        if abs(deviation[worst]) > allowed:
            loaded = np.count_nonzero(np.abs(deviation) > allowed)
            raise TareRefusedError(
                f'under load: {loaded} tactels are off the no-load baseline, row {worst[0]} '
                f'column {worst[1]} by {deviation[worst]:+.1f} counts, at most '
                f'{allowed:.1f} are allowed')

    def converter(self, tare=None):
        """
        Return the function that turns raw counts into a picture; without tare, by the baseline.

        It takes counts `(rows, columns)`, uint8, and returns `(Layer, saturated)`: stress with
        NaN for dead and saturated tactels, and the number of live ones that are saturated.
        """
        offset = self.baseline if tare is None else tare.offset
        zero = np.where(self.live, self.gain * offset, np.nan).astype(np.float32)
        template = self.layer(tare)

        def convert(counts):
            stress = self.gain * counts
            stress -= zero
            saturated = 0
            if counts.max() >= self.saturation:
                invalid = (counts >= self.saturation) & self.live
                stress[invalid] = np.nan
                saturated = int(np.count_nonzero(invalid))
            return Layer(template.component, template.depth, stress, template.full_scale,
                         template.noise_std, template.unit), saturated

        return convert

    def layer(self, tare=None) -> Layer:
        """Return the layer without values: component, depth, unit, full scale and noise."""
        offset = self.baseline if tare is None else tare.offset
        # The full scale that every live tactel reaches; counts below saturation are valid.
        full_scale = (self.gain * (self.saturation - offset))[self.live].min()
        noise = 0.0 if tare is None else tare.noise_std * float(self.gain[self.live].mean())
        return Layer(self.component, self.depth, np.empty(0, np.float32), float(full_scale),
                     noise, self.unit)

    def sensor_info(self, sensor, frame_id, stamp_ns, tare=None, tared_at_ns=0) -> SensorInfo:
        """Return what is known of the sensor, for those who read its pictures."""
        return SensorInfo(
            stamp_ns=stamp_ns, frame_id=frame_id, sensor=sensor, model=self.model,
            serial_number=self.serial_number, array=self.array, nominal_rate=self.nominal_rate,
            acquisition_delay=self.acquisition_delay, skin_stiffness=self.skin_stiffness,
            max_load=self.max_load, layers=(self.layer(tare),), dead_tactels=self.dead_tactels,
            calibration=self.source, tared_at_ns=tared_at_ns)


_FILE_KEYS = {'rows', 'columns', 'pitch', *(f.name for f in fields(Calibration))} - {
    'array', 'source', 'live'}


def load_calibration(path) -> Calibration:
    """
    Read a calibration file.

    YAML with the fields of `Calibration` as keys, but `rows`, `columns` and `pitch` ([m], one
    value or x and y) for the array and `[row, column]` pairs for `dead_tactels`.

    Raises
    ------
    ConfigurationError
        The file cannot be read, or a key is missing, unknown or out of bounds; names the file.
    """
    try:
        return _from_mapping(read_yaml(path), str(path))
    except ConfigurationError as error:
        raise ConfigurationError(f'calibration {path}: {error}') from error


def _from_mapping(values, source):
    if not isinstance(values, dict):
        raise ConfigurationError('must be a mapping of keys to values')
    unknown = sorted(str(key) for key in set(values) - _FILE_KEYS)
    if unknown:
        raise ConfigurationError(
            f'unknown key {unknown[0]!r}, must be one of {", ".join(sorted(_FILE_KEYS))}')
    for key in ('rows', 'columns', 'pitch', 'gain'):
        if key not in values:
            raise ConfigurationError(f'key {key!r} is missing')
    values = dict(values)
    pitch_x, pitch_y = _pair(values.pop('pitch'))
    array = TactelArray(values.pop('rows'), values.pop('columns'), pitch_x, pitch_y)
    dead = _indices(values.pop('dead_tactels', None) or [], array)
    return Calibration(array, dead_tactels=dead, source=source, **values)


def _indices(pairs, array):
    indices = []
    for pair in pairs if isinstance(pairs, list) else [pairs]:
        if (not isinstance(pair, list) or [type(value) for value in pair] != [int, int]
                or not (0 <= pair[0] < array.rows and 0 <= pair[1] < array.columns)):
            raise ConfigurationError(
                f'dead_tactels holds {pair!r}, must be pairs [row, column] below '
                f'[{array.rows}, {array.columns}]')
        indices.append(pair[0] * array.columns + pair[1])
    return tuple(indices)


def _pair(pitch):
    if isinstance(pitch, (list, tuple)):
        if len(pitch) != 2:
            raise ConfigurationError(f'pitch is {pitch!r}, must be one length or two [m]')
        return tuple(pitch)
    return pitch, pitch


def _is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool)
