"""Where the frames of `estimate` come from, and what is known of their sensor."""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass, replace
from itertools import islice
import math
from typing import Any

import numpy as np

from tactile_common.command_line import reading_bags
from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import ArrayReader
from tactile_sensing.cli.estimate_options import layer_values, parse_dead, parse_layers
from tactile_sensing.cli.options import counts_reader, is_bag, MAX_CHUNK, pitch_of, read_counts
from tactile_sensing.contact.estimator import ContactEstimator
from tactile_sensing.devices.calibration_file import load_calibration
from tactile_sensing.devices.tare import TareRefusedError
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import COLUMNS, Contact, REALS, RECORD, STAMPED
from tactile_sensing.types.image import Layer

CHUNK_BYTES = 1 << 20


@dataclass
class Frames:
    """Frames of an array, and how they become stress."""

    reader: Any
    array: TactelArray
    layers: list[Layer]  # without their stress
    to_stress: Callable[[np.ndarray], np.ndarray]
    dead: np.ndarray  # (rows, columns)
    tactel: str | None = None  # what a tactel measures, if it is known
    dtype: np.dtype = RECORD

    @property
    def total(self) -> int:
        """Return the number of frames."""
        return self.reader.shape[0]

    def records(self, estimator: ContactEstimator) -> Iterator[np.ndarray]:
        """Yield what is estimated of all frames in turn, some at a time."""
        frame_size = math.prod(self.reader.shape[1:]) * self.reader.dtype.itemsize
        for frames in self.reader.chunks(min(max(CHUNK_BYTES // frame_size, 1), MAX_CHUNK)):
            stress = self.to_stress(frames)
            stress[..., self.dead] = np.nan
            yield estimator.estimate_batch(stress, self.array, self.layers)


class Pictures:
    """Pictures of a bag, which say themselves what their sensor is."""

    tactel, dtype = None, STAMPED

    def __init__(self, options: argparse.Namespace):
        with reading_bags():
            from tactile_sensing.observations import RecordedPictures
        self._pictures = RecordedPictures(options.frames, options.namespace)
        self.total = self._pictures.total
        self._known = layer_values(options)
        self._dead = parse_dead(options.dead, self._pictures.array)

    def records(self, estimator: ContactEstimator) -> Iterator[np.ndarray]:
        """Likewise."""
        told = (_record(picture.stamp_ns, estimator.estimate(self._completed(picture)))
                for picture in self._pictures)
        while some := list(islice(told, MAX_CHUNK)):
            yield np.array(some, STAMPED)

    def _completed(self, picture):
        """Picture with what the options say."""
        layers = tuple(replace(
            layer, stress=np.where(self._dead, np.nan, layer.stress), **self._known)
            for layer in picture.layers)
        return replace(picture, layers=layers)


def _record(stamp_ns: int, contact: Contact) -> tuple:
    """Values of one row of STAMPED."""
    values = {name: getattr(contact, name) for name in COLUMNS}
    values['moments'] = astuple(contact.moments)
    if not contact.valid:
        values |= dict.fromkeys(REALS, np.nan)
    return *values.values(), 1e-9 * stamp_ns


def source_of(options: argparse.Namespace) -> Frames | Pictures:
    """Return the frames that the options name."""
    if options.calibration:
        return _calibrated(options)
    return Pictures(options) if is_bag(options.frames) else _plain(options)


def _plain(options):
    """Frames of stress, of the sensor that the options describe."""
    reader = ArrayReader(options.frames, 'frames')
    layers = parse_layers(options.layers)
    pitch_x, pitch_y = pitch_of(options.pitch)
    shape = reader.shape
    if len(shape) not in (3, 4) or 0 in shape:
        raise ConfigurationError(
            f'{options.frames}: frames has shape {shape}, must be (N, rows, columns) or (N, '
            'layers, rows, columns), none of them 0')
    if reader.dtype.kind not in 'uif':
        raise ConfigurationError(
            f'{options.frames}: frames is of type {reader.dtype}, must be of real numbers')
    there = 1 if len(shape) == 3 else shape[1]
    if there != len(layers):
        raise ConfigurationError(
            f'--layers names {len(layers)} (of {options.layers}), but frames has shape {shape}: '
            f'{there} layer{"s" * (there > 1)}')
    known, (rows, columns) = layer_values(options), shape[-2:]
    array = TactelArray(rows, columns, pitch_x, pitch_y)
    return Frames(reader, array,
                  [Layer(component, depth, np.empty(0), **known) for component, depth in layers],
                  lambda frames: np.array(frames, dtype=np.float64),
                  parse_dead(options.dead, array))


def _calibrated(options):
    """Frames of counts, of the sensor that a calibration describes."""
    calibration, tare = load_calibration(options.calibration), None
    shape = calibration.raw_shape
    reader = counts_reader(options.frames, shape, options.namespace)
    if options.tare:
        try:
            tare = calibration.make_tare(read_counts(options.tare, shape, options.namespace))
        except TareRefusedError as error:
            raise ConfigurationError(f'--tare {options.tare}: {error}') from error
    return Frames(reader, calibration.array,
                  [replace(calibration.layer(tare), **layer_values(options))],
                  lambda frames: calibration.stress(frames, tare),
                  parse_dead(options.dead, calibration.array), calibration.tactel or None)
