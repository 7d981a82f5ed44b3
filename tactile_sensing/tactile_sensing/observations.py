"""What was recorded of a sensor and its robot, in the order of time: bags as they were seen."""
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any, NamedTuple

import numpy as np

from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.ros.bag_reader import Bag, DAMAGE
from tactile_common.ros.conversions import pose_from_msg, stamp_to_ns
from tactile_sensing.conversions import contact_from_msg, image_from_msg, sensor_info_from_msg
from tactile_sensing.types.image import TactileImage


class JointState(NamedTuple):
    """Names of joints and their positions (n,) [rad or m]."""

    names: tuple[str, ...]
    positions: np.ndarray


def joint_state_from_msg(message) -> JointState:
    """
    Return the joints of a JointState message.

    Raises
    ------
    TactileError
        There are not as many positions as names.
    """
    if len(message.name) != len(message.position):
        raise TactileError(
            f'joint state has {len(message.position)} positions of {len(message.name)} joints')
    return JointState(tuple(message.name), np.array(message.position, dtype=float))


# Name of the topic: its type, and what its messages become.
KINDS: dict[str, tuple[str, Callable[[Any], Any]]] = {
    'image': ('tactile_msgs/msg/TactileImage', image_from_msg),
    'sensor_info': ('tactile_msgs/msg/SensorInfo', sensor_info_from_msg),
    'contact': ('tactile_msgs/msg/Contact', contact_from_msg),
    'sensor_pose': ('geometry_msgs/msg/PoseStamped', lambda message: pose_from_msg(message.pose)),
    'joint_states': ('sensor_msgs/msg/JointState', joint_state_from_msg),
}
TYPES = {kind: message_type for kind, (message_type, _) in KINDS.items()}


@dataclass(frozen=True, eq=False, slots=True)
class Observation:
    """
    A message of a recording, converted when it is asked for its value.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    stamp_ns, received_ns : int
        When it was measured, and received [ns].
    """

    kind: str
    stamp_ns: int
    received_ns: int
    _message: Any
    _bag: Bag
    _topic: str

    def value(self):
        """
        Return the TactileImage, SensorInfo, Contact, pose (4, 4) or JointState.

        Raises
        ------
        ConfigurationError
            The message is damaged, or of an older definition that lacks a field.
        """
        _, convert = KINDS[self.kind]
        try:
            return convert(self._message)
        except (TactileError, *DAMAGE) as error:
            raise self._bag.damaged(self._topic, self.received_ns, error) from error


def observations(bag: Bag, topics: Mapping[str, str]) -> Iterator[Observation]:
    """
    Yield what was recorded, in the order of its reception, as it reached a node.

    Parameters
    ----------
    bag : Bag
    topics : mapping
        From topics, which may be missing, to their kind, of `KINDS`.

    Raises
    ------
    ConfigurationError
        The bag is damaged.
    """
    for topic, received_ns, message in bag.messages(topics):
        try:
            stamp_ns = stamp_to_ns(message.header.stamp)
        except DAMAGE as error:
            raise bag.damaged(topic, received_ns, error) from error
        yield Observation(topics[topic], stamp_ns, received_ns, message, bag, topic)


class RecordedPictures:
    """
    The pictures of one sensor in a bag, in the order of their reception.

    Parameters
    ----------
    path : path
        Folder, `.mcap` or `.db3` file of a rosbag2 recording.
    namespace : str, optional
        Of the sensor; may be left out where there is one.

    Raises
    ------
    ConfigurationError
        The bag or a message in it is damaged, it has no pictures, those of several sensors, or
        of arrays that differ.
    """

    def __init__(self, path: str | PathLike, namespace: str | None = None):
        self._path = path
        with Bag(path) as bag:
            self._topic = bag.namespace_of({'image': TYPES['image']}, namespace) + '/image'
            self.total = bag.count(self._topic)
        first = next(iter(self._read()), None)
        if first is None:
            raise ConfigurationError(f'bag {path}: no picture on {self._topic}')
        self.array = first.array

    def __iter__(self) -> Iterator[TactileImage]:
        for picture in self._read():
            if picture.array != self.array:
                raise ConfigurationError(
                    f'bag {self._path}: pictures on {self._topic} are of {self.array} and of '
                    f'{picture.array}')
            yield picture

    def _read(self):
        with Bag(self._path) as bag:
            for seen in observations(bag, {self._topic: 'image'}):
                yield seen.value()


class RecordedCounts(RecordedPictures):
    """Likewise, of a driver that passes counts through, with what an ArrayReader has."""

    dtype = np.empty(0, np.float32).dtype

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of all frames, (N, rows, columns)."""
        return self.total, *self.array.shape

    def chunks(self, rows: int) -> Iterator[np.ndarray]:
        """Yield frames of counts, (n, rows, columns), n at most `rows`."""
        frames = []
        for picture in self:
            frames.append(picture.raw_counts()[0])
            if len(frames) == rows:
                yield np.array(frames)
                frames.clear()
        if frames:
            yield np.array(frames)
