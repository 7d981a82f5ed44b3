"""Read the recorded messages of a sensor from a bag, in the order of reception."""
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from os import PathLike
from typing import Any

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.ros.bag_reader import Bag, Recorded
from tactile_common.ros.conversions import pose_from_msg
from tactile_sensing.conversions import contact_from_msg, image_from_msg
from tactile_sensing.types.image import TactileImage

# Message types of the topics of a sensor and its robot, by topic name.
TYPES = {'image': 'tactile_msgs/msg/TactileImage', 'sensor_info': 'tactile_msgs/msg/SensorInfo',
         'contact': 'tactile_msgs/msg/Contact', 'sensor_pose': 'geometry_msgs/msg/PoseStamped',
         'joint_states': 'sensor_msgs/msg/JointState'}
_CONVERTED: dict[str, Callable[[Any], Any]] = {
    'image': image_from_msg, 'contact': contact_from_msg,
    'sensor_pose': lambda message: pose_from_msg(message.pose)}


@dataclass(frozen=True, eq=False, slots=True)
class BagMessage:
    """A recorded message; it is converted when its value is requested."""

    kind: str  # 'image', 'contact' or 'sensor_pose'
    stamp_ns: int  # time of the measurement [ns]
    _row: Recorded

    def value(self) -> Any:
        """Return the TactileImage, Contact or pose (4, 4); ConfigurationError if damaged."""
        with self._row.reading():
            return _CONVERTED[self.kind](self._row.message)


def observations(bag: Bag, topics: Mapping[str, str]) -> Iterator[BagMessage]:
    """
    Yield the messages of topics, given with their kinds, as received; one may be missing.

    Raises a ConfigurationError if the bag is damaged.
    """
    for row in bag.messages(topics):
        yield BagMessage(topics[row.topic], row.stamp_ns, row)


class RecordedImages:
    """
    The images of one sensor in a bag, in the order of reception.

    The namespace may be omitted if the bag has one sensor only. Raises a ConfigurationError if
    the bag or a message is damaged, if there are no images or the sensor is ambiguous, or if the
    images differ in their array.
    """

    def __init__(self, path: str | PathLike, namespace: str | None = None):
        self._path = path
        with Bag(path) as bag:
            self._topic = bag.namespace_of({'image': TYPES['image']}, namespace) + '/image'
            self.total = bag.count(self._topic)
        first = next(self._read(), None)
        if first is None:
            raise ConfigurationError(f'bag {path}: no image on {self._topic}')
        if not first.layers:
            raise ConfigurationError(f'bag {path}: the first image on {self._topic} has no layer')
        self.array, self.layer = first.array, first.layers[0]

    def __iter__(self) -> Iterator[TactileImage]:
        for image in self._read():
            if image.array != self.array:
                raise ConfigurationError(
                    f'bag {self._path}: images on {self._topic} are of {self.array} and of '
                    f'{image.array}')
            yield image

    def _read(self) -> Iterator[TactileImage]:
        with Bag(self._path) as bag:
            for seen in observations(bag, {self._topic: 'image'}):
                yield seen.value()


class RecordedCounts(RecordedImages):
    """Recorded images of raw counts, with the interface of an ArrayReader."""

    dtype = np.dtype(np.float32)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of all frames, (N, rows, columns)."""
        return self.total, *self.array.shape

    @property
    def signed(self) -> bool:
        """Whether counts may be negative, i.e. the floor is below 0."""
        return self.layer.floor < 0.0

    @property
    def bits(self) -> int | None:
        """Number of bits for the counts up to full scale; None if full scale is unknown."""
        full = self.layer.full_scale
        return int(full).bit_length() + self.signed if full >= 1.0 and full % 1.0 == 0 else None

    def chunks(self, rows: int) -> Iterator[np.ndarray]:
        """Yield chunks of frames of counts; ConfigurationError if tared or calibrated."""
        counts = (_raw_counts(image) for image in self)
        while frames := list(islice(counts, rows)):
            yield np.array(frames)


def _raw_counts(image: TactileImage) -> np.ndarray:
    if not image.layers or image.layers[0].unit != 'counts' or image.tared:
        raise ConfigurationError(
            'no raw counts in the images: start the driver with tare_at_start:=false and a '
            'calibration of `rows`, `columns`, `pitch`, `bits`, `unit: counts` and `gain: 1` '
            'alone')
    layer = image.layers[0]
    full = np.isnan(layer.stress)
    if full.any() and not layer.full_scale:
        raise ConfigurationError(
            f'image at {1e-9 * image.stamp_ns:.6f} s: {full.sum()} tactels are NaN, but '
            '`full_scale` is 0 (unknown): it must be that of the sensor')
    return np.where(full, layer.full_scale, layer.stress)
