"""Offline command: the contact in every frame of a file."""

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
import math
import os
from pathlib import Path
import time

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import ArrayReader, RecordWriter
from tactile_common.progress import Progress
from tactile_sensing.cli.estimate_options import (
    layer_values,
    make_config,
    parse,
    parse_dead,
    parse_layers,
)
from tactile_sensing.cli.options import counts_reader, MAX_CHUNK, pitch_of, read_all, run_command
from tactile_sensing.contact.estimator import ContactEstimator
from tactile_sensing.devices.calibration_file import load_calibration
from tactile_sensing.devices.tare import TareRefusedError
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import ContactType, INFORMATION, Reason, RECORD
from tactile_sensing.types.image import Layer

CHUNK_BYTES = 1 << 20
QUIET = 1.0  # s without a progress bar


@dataclass(frozen=True)
class Source:
    """The sensor that frames are from, and how they become stress."""

    array: TactelArray
    layers: list[Layer]  # without their stress
    to_stress: Callable[[np.ndarray], np.ndarray]
    tactel: str | None = None  # what a tactel measures, if it is known


def plain_source(options: argparse.Namespace, reader: ArrayReader) -> Source:
    """Frames of stress, of the sensor that the options describe."""
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
    return Source(TactelArray(rows, columns, pitch_x, pitch_y),
                  [Layer(component, depth, np.empty(0), **known) for component, depth in layers],
                  lambda frames: np.array(frames, dtype=np.float64))


def calibrated_source(options: argparse.Namespace) -> Source:
    """Frames of counts, of the sensor that a calibration describes."""
    calibration, tare = load_calibration(options.calibration), None
    counts_reader(options.frames, calibration.raw_shape)
    if options.tare:
        try:
            tare = calibration.make_tare(
                read_all(counts_reader(options.tare, calibration.raw_shape)))
        except TareRefusedError as error:
            raise ConfigurationError(f'--tare {options.tare}: {error}') from error
    return Source(calibration.array, [replace(calibration.layer(tare), **layer_values(options))],
                  lambda frames: calibration.stress(frames, tare), calibration.tactel or None)


class Tally:
    """Counts of what was found."""

    def __init__(self):
        self._types = dict.fromkeys(ContactType, 0)
        self._refusals = dict.fromkeys(Reason, 0)
        self._invalid = 0

    def add(self, records):
        """Count rows of the output."""
        refused = records['reasons'][~records['valid']]
        self._invalid += len(refused)
        for kind in self._types:
            self._types[kind] += int(np.count_nonzero(records['type'] == kind))
        for reason in self._refusals:
            if not reason & INFORMATION:
                self._refusals[reason] += int(np.count_nonzero(refused & int(reason)))

    def __str__(self):
        types, reasons = (', '.join(
            f'{count} {str(key.name).lower()}' for key, count in counts.items() if count)
            for counts in (self._types, self._refusals))
        return f'{types}; {self._invalid} not valid' + (f': {reasons}' if reasons else '')


def run(options: argparse.Namespace) -> str:
    """Estimate every frame of the input; returns the summary."""
    reader = ArrayReader(options.frames, 'frames')
    source = calibrated_source(options) if options.calibration else plain_source(options, reader)
    config, dead = make_config(options, source.tactel), parse_dead(options.dead, source.array)
    if Path(options.out).exists() and os.path.samefile(options.frames, options.out):
        raise ConfigurationError(f'{options.out}: is the input as well')
    total = reader.shape[0]
    frame_size = math.prod(reader.shape[1:]) * reader.dtype.itemsize
    chunk = min(max(CHUNK_BYTES // frame_size, 1), MAX_CHUNK)
    tally, done = Tally(), 0
    with RecordWriter(options.out, RECORD, total) as writer:
        estimator = ContactEstimator(config)
        begin = time.perf_counter()
        with Progress(total, QUIET) as progress:
            for frames in reader.chunks(chunk):
                stress = source.to_stress(frames)
                stress[..., dead] = np.nan
                records = estimator.estimate_batch(stress, source.array, source.layers)
                done += len(frames)
                progress.show(done, 'estimate', f'{done} of {total} frames')
                tally.add(records)
                writer.append(records)
        rate = total / max(time.perf_counter() - begin, 1e-9)
    return f'{options.out}: {total} frames, {rate:.0f} frames/s; {tally}'


def main(args: list[str] | None = None) -> int:
    """Run the command; exit status 0 if the output was written."""
    return run_command('estimate', lambda: f'estimate: {run(parse(args))}')
