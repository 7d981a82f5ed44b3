"""Recording of a real array's frames: through the driver's conversion and the estimator."""
from argparse import Namespace
from pathlib import Path
import sys
import time
from typing import Any

import numpy as np

from edge_tracking.recording.record_bag import BagWriter
from edge_tracking.recording.topics import topics
from edge_tracking.resources import NAMESPACE
from tactile_common.parameter_file import ParameterFile
from tactile_common.progress import Progress
from tactile_common.ros.cdr import packed
from tactile_common.ros.conversions import NS
from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.conversions import contact_to_msg, image_to_msg, sensor_info_to_msg
from tactile_sensing.devices.calibration import Calibration, load_calibration
from tactile_sensing.devices.counts import Counts, MAX_BITS
from tactile_sensing.devices.image_converter import ImageConverter
from tactile_sensing.devices.recording import Recording

MAX_OFFSET = 0.1  # summed offset of unloaded tactels, as a share of the largest load
FRAME, SENSOR = 'tactile_pad', 'recording'


def calibrated(options: Namespace, recording: Recording) -> tuple[Calibration, np.ndarray]:
    """
    Return the calibration of a recording from the demo's options, and its frames in counts.

    Raises a ValueError if the two do not match.
    """
    rows, columns = recording.shape
    if options.calibration:
        calibration, source = load_calibration(options.calibration), options.calibration
    elif options.pitch or recording.pitch:
        calibration = Calibration.uncalibrated(
            rows, columns, options.pitch or recording.pitch, nominal_rate=recording.rate_hz,
            dead_tactels=tuple(recording.absent), **_range_of(recording))
        source = 'the recording'
    else:
        raise ValueError(f'{options.recording}: no pitch_m in the file; give --pitch')
    if calibration.raw_shape != (rows, columns):
        raise ValueError(f'{options.recording}: frames of {rows}x{columns}, but '
                         f'{options.calibration} is for {calibration.raw_shape}')
    counts, impossible = recording.counts(calibration.counts, calibration.resolution)
    if impossible:
        raise ValueError(
            f'{options.recording}: {impossible} values are outside {calibration.counts.lowest} to '
            f'{calibration.counts.highest}, what `bits: {calibration.bits}` of {source} allows')
    offset = _offset(calibration, counts) * calibration.resolution
    if offset and options.calibration:
        print(f'{options.recording}: nearly all tactels read {offset:+.3g} and more off the '
              f'baseline of {source}: if nothing touched them, every place is wrong',
              file=sys.stderr)
    elif offset:
        raise ValueError(
            f'{options.recording}: tactels without a load read {offset:+.3g}, an offset that '
            'moves every place: give a --calibration CAL.yaml with their baseline, or subtract '
            'the unloaded picture')
    return calibration, counts


def _range_of(recording: Recording) -> dict[str, Any]:
    """Return the fields of a calibration that can represent unknown frames without loss."""
    values = recording.frames[np.isfinite(recording.frames)]
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    signed = low < 0.0
    if np.array_equal(values, np.rint(values)):
        for bits in (8, MAX_BITS):
            limits = Counts(bits, signed)
            if limits.lowest <= low and high <= limits.highest:
                return {'bits': bits, 'signed': signed}
    step = max(-low, high) / 32000  # for real numbers, such as volts: images keep their unit
    return {'bits': MAX_BITS, 'signed': True, 'resolution': step, 'gain': step}


def _offset(calibration: Calibration, frames: np.ndarray) -> float:
    """Return the offset of nearly all tactels from the baseline [counts]; 0 if negligible."""
    counts, live = calibration.arrange(frames), calibration.live
    above = np.where(counts < calibration.counts.threshold, 0.0, counts - calibration.baseline)
    above = above[:, live]
    low, high = np.percentile(np.median(above, axis=0), (10, 90))
    offset = max(low, 0.0) + min(high, 0.0)  # percentiles exclude tactels under a steady load
    load = np.abs(above.sum(axis=1) - offset * live.sum()).max()
    return float(offset) if abs(offset) * live.sum() > MAX_OFFSET * load else 0.0


def record_frames(counts: np.ndarray, rate: float, calibration: Calibration, bag: Path,
                  parameters: str | Path) -> None:
    """
    Write images and contacts into a new bag, as driver and estimator do.

    `counts` are frames (N, rows, columns), `rate` is their number per second [Hz].
    """
    estimator = ContactEstimator(ParameterFile(parameters).config(
        f'/{NAMESPACE}/contact_estimator', EstimatorConfig))
    pad, begin = ImageConverter(calibration), time.time_ns()
    writer = BagWriter(bag, topics(NAMESPACE))
    writer.write('sensor_info', begin, packed(sensor_info_to_msg(
        calibration.sensor_info(SENSOR, FRAME, begin, None, 0))))
    with Progress(len(counts)) as progress:
        for number, frame in enumerate(counts):
            taken = begin + round(NS * number / rate)
            image = pad.image(frame, taken, number)
            image.frame_id, image.sensor = FRAME, SENSOR
            estimated = time.monotonic_ns()
            contact = estimator.estimate(image)
            now = taken + time.monotonic_ns() - estimated
            message = image_to_msg(image)
            writer.write('image', taken, packed(message))
            writer.write('contact', now, packed(contact_to_msg(contact, message, now)))
            progress.show(number, 'playing', f'{number} of {len(counts)} frames')
    writer.close()
