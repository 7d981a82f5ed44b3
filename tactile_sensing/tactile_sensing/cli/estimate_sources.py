"""Sources of the frames of `estimate`, with the properties of their sensor."""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import astuple, replace
from itertools import islice
import math
from typing import Any, NamedTuple

import numpy as np

from tactile_common.command_line import reading_bags
from tactile_common.config import checked
from tactile_common.errors import ConfigurationError
from tactile_sensing.cli.options import counts_reader, is_bag
from tactile_sensing.contact.estimator import ContactEstimator, METHODS
from tactile_sensing.devices.calibration import Calibration, load_calibration, pitch_pair
from tactile_sensing.devices.recording import CHUNK, FrameReader, read_whole
from tactile_sensing.devices.tare import TareRefusedError
from tactile_sensing.types.array import PITCH, TactelArray
from tactile_sensing.types.contact import COLUMNS, Contact, REALS, RECORD, STAMPED
from tactile_sensing.types.image import COMPONENTS, Layer, TactileImage

CHUNK_BYTES = 1 << 20


class Source(NamedTuple):
    """Frames of a file or bag, and how their sensor measures."""

    total: int  # number of frames
    records: Callable[[ContactEstimator], Iterator[np.ndarray]]  # estimates in order, in chunks
    dtype: np.dtype = RECORD
    tactel: str | None = None  # 'area' or 'point', if known


def source_of(options: argparse.Namespace) -> Source:
    """Return the source of the frames for the options."""
    if options.calibration:
        return _calibrated(options)
    return _images(options) if is_bag(options.frames) else _plain(options)


def _frames(reader: Any, array: TactelArray, layers: list[Layer],
            to_stress: Callable[[np.ndarray, int], np.ndarray],
            tactel: str | None = None) -> Source:
    """Return the frames of a reader; `to_stress` takes frames and the number of the first one."""
    def records(estimator: ContactEstimator) -> Iterator[np.ndarray]:
        frame_size, done = math.prod(reader.shape[1:]) * reader.dtype.itemsize, 0
        for frames in reader.chunks(min(max(CHUNK_BYTES // frame_size, 1), CHUNK)):
            stress = to_stress(frames, done)
            done += len(frames)
            yield estimator.estimate_batch(stress, array, layers)
    return Source(reader.shape[0], records, tactel=tactel)


def _images(options: argparse.Namespace) -> Source:
    """Return the images of a bag; they contain the properties of their sensor."""
    with reading_bags():
        from tactile_sensing.observations import RecordedImages
    images, noise = RecordedImages(options.frames, options.namespace), options.noise

    def completed(image: TactileImage) -> TactileImage:
        return image if noise is None else replace(image, layers=tuple(
            replace(layer, noise_std=noise) for layer in image.layers))

    def records(estimator: ContactEstimator) -> Iterator[np.ndarray]:
        found = (_record(image.stamp_ns, estimator.estimate(completed(image)))
                 for image in images)
        while some := list(islice(found, CHUNK)):
            yield np.array(some, STAMPED)
    return Source(images.total, records, STAMPED)


def _record(stamp_ns: int, contact: Contact) -> tuple:
    """Return the values of one row of STAMPED."""
    values = {name: getattr(contact, name) for name in COLUMNS}
    values['moments'] = astuple(contact.moments)
    if not contact.valid:
        values |= dict.fromkeys(REALS, np.nan)
    return *values.values(), 1e-9 * stamp_ns


def parse_layers(text: str) -> tuple[tuple[str, float], ...]:
    """Return the component and depth [m] of each layer of `COMPONENT@DEPTH,...`."""
    layers = []
    for layer in text.split(','):
        component, _, depth = layer.strip().partition('@')
        if component not in COMPONENTS:
            raise ConfigurationError(
                f'--layers: component {component!r} is not one of {", ".join(COMPONENTS)}')
        name = f'--layers: depth of {component}'
        try:
            value = float(depth)
        except ValueError:
            raise ConfigurationError(f'{name} is {depth!r}, must be a number') from None
        layers.append((component, checked(name, value, float, {'range': PITCH, 'unit': 'm'})))
    if 'zz' not in [component for component, _ in layers]:
        raise ConfigurationError(f'--layers: {text} has no layer of pressure (zz)')
    return tuple(layers)


def _plain(options: argparse.Namespace) -> Source:
    """Return frames of stress from a sensor that the options describe."""
    reader = FrameReader(options.frames, options.shape and tuple(options.shape))
    if reader.dtype.kind != 'f' and options.scale is None:
        raise ConfigurationError(
            f'{options.frames}: frames are counts ({reader.dtype}): --calibration CAL.yaml says '
            'what a count means; or subtract the unloaded image and save floats, or, if that is '
            'done, give --scale PA_PER_COUNT (without --layers 1 will do)')
    # A depth of 0 means an unknown skin; then there are no forces.
    unit = 'Pa' if options.layers is not None else 'counts'
    layers = (('zz', 0.0),) if options.layers is None else parse_layers(options.layers)
    there = 1 if len(reader.shape) == 3 else reader.shape[1]
    if there != len(layers):
        raise ConfigurationError(
            f'--layers names {len(layers)} (of {options.layers or "zz"}), but frames has shape '
            f'{reader.shape}: {there} layer{"s" * (there > 1)}')
    if options.layers is None and options.method in METHODS[1:]:
        raise ConfigurationError(f'--method {options.method} needs --layers: a closed form of the '
                                 'thesis takes the depth of the tactels')
    scale, (rows, columns) = options.scale or 1.0, reader.shape[-2:]
    return _frames(
        reader, TactelArray(rows, columns, *pitch_pair(options.pitch)),
        [Layer(*layer, np.empty(0), unit=unit, noise_std=options.noise or 0.0)
         for layer in layers],
        lambda frames, first: scale * frames.astype(np.float64))


def _calibrated(options: argparse.Namespace) -> Source:
    """Return frames of counts from a sensor that a calibration describes."""
    calibration, tare = load_calibration(options.calibration), None

    def reader_of(path: str) -> Any:
        return counts_reader(
            path, calibration.resolution, calibration.raw_shape, options.namespace)
    reader = reader_of(options.frames)
    if options.tare:
        unloaded = read_whole(options.tare, reader_of(options.tare))
        try:
            tare = calibration.make_tare(unloaded)
        except TareRefusedError as error:
            raise ConfigurationError(f'--tare {options.tare}: {error}') from error
    layer = calibration.layer(tare)
    if options.noise is not None:
        layer = replace(layer, noise_std=options.noise)

    def to_stress(frames: np.ndarray, first: int) -> np.ndarray:
        counts = frames.astype(np.float64)
        _check_counts(options, calibration, counts, first)
        stress = calibration.stress(counts, tare)
        # Saturated, not dead (NaN).
        stress[calibration.full(calibration.arrange(counts))] = layer.full_scale
        return stress
    return _frames(reader, calibration.array, [layer], to_stress, calibration.tactel or None)


def _check_counts(options: argparse.Namespace, calibration: Calibration, counts: np.ndarray,
                  first: int) -> None:
    """Refuse counts that the converter cannot send."""
    limits = calibration.counts
    outside = limits.outside(counts) & np.isfinite(counts)
    if outside.any():
        k, row, column = np.argwhere(outside)[0]
        raise ConfigurationError(
            f'{options.frames}: frame {first + k}, row {row}, column {column} reads '
            f'{counts[k, row, column]:.6g} counts, but `bits: {limits.bits}` of '
            f'{options.calibration} allows {limits.lowest} to {limits.highest}: set `bits` and '
            '`signed` there as the sensor has them')
