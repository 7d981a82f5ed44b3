"""Reader of a run from its recording: converts messages to arrays."""
from array import array
from collections import Counter, defaultdict
from collections.abc import Callable
import json
from typing import Any

import numpy as np

from edge_tracking.recording import run
from edge_tracking.recording.settings import Settings
from edge_tracking.recording.topics import RecordedTopics
from tactile_common.ros.bag_reader import Bag
from tactile_common.ros.conversions import stamp_to_ns
from tactile_sensing.conversions import sensor_info_from_msg
from tactile_sensing.types.array import TactelArray
from tactile_servo.journal import Call, WITH_TEXT
from tactile_shape.conversions import patch_from_msg
from tactile_simulation.metrics import accelerations

MOST = 60_000  # messages of a topic, evenly spaced, that are read; of others only the stamps
_COMPONENT_ZZ = 0


def read_run(path, namespace=None, *, joints=True) -> run.RunData:
    """
    Read a run from a rosbag2 recording: its folder, or one of its files.

    Without `joints` the joint states are not read. Raises a ConfigurationError if there is no
    recording, or if it contains several sensors and no namespace is given.
    """
    with Bag(path) as bag, bag.clear_errors():
        topics = RecordedTopics(bag, namespace)
        wanted = {topic: name for topic, name in topics.name.items()
                  if name in _READ and (joints or name != 'joint_states')}
        every = {name: -(-bag.count(topic) // MOST) or 1 for topic, name in wanted.items()
                 if name in _THINNED}
        rows, seen = defaultdict(list), Counter()
        stamps = {name: array('q') for name in _STAMPED}
        for row in bag.messages(wanted, raw=True):
            name = wanted[row.topic]
            if name in stamps:
                stamps[name].append(bag.stamp_ns(row))
            seen[name] += 1
            if (seen[name] - 1) % every.get(name, 1):
                continue
            if name in _NEWEST:
                rows[name].clear()
            try:
                rows[name] += _READ[name](bag.unpacked(row))
            except AttributeError as error:
                raise bag.damaged(row.topic, row.received_ns, error) from error
        return run.RunData(
            namespace=topics.prefix,
            start_ns=bag.span[0],
            images=_images(rows['image']),
            contacts=run.Contacts.of(rows['contact']),
            statuses=run.Statuses.of(rows['servo_status']),
            poses=run.Poses.of(rows['sensor_pose']),
            contour=np.array(rows['contour'], float).reshape(-1, 3),
            patches=rows['surface_patch'],
            info=next(iter(rows['sensor_info']), None),
            nodes=frozenset(rows['diagnostics']),
            touches=run.Poses.of(rows['surface_contact']),
            joint_acceleration=_joint_acceleration(rows['joint_states']),
            stamps={name: np.asarray(known) for name, known in stamps.items()},
            every=every,
            goals=rows['servo_calls'],
            parameters=Settings.of(bag, topics).recorded,
        )


def _image(message):
    """Return a list with shallowest pressure, (unit, pitches) and columns, or an empty list."""
    layers = [layer for layer in message.layers if layer.component == _COMPONENT_ZZ
              and layer.stress.size == message.rows * message.columns > 0]
    return [(layer.stress.reshape(message.rows, message.columns),
             (layer.unit, message.pitch_x, message.pitch_y), run.Images.row(message))
            for layer in sorted(layers, key=lambda layer: layer.depth)[:1]]


def _images(rows):
    """Return the table of images that have the shape of the first one."""
    if not rows:
        return run.Images.of([], frames=np.empty((0, 0, 0), np.float32), array=None, unit='')
    first, (unit, *pitches), _ = rows[0]
    frames, _, kept = zip(*(row for row in rows if row[0].shape == first.shape), strict=True)
    return run.Images.of(kept, frames=np.array(frames, np.float32), unit=unit,
                         array=TactelArray(*first.shape, *pitches))


def _goals(calls):
    """Return the fields of the goals that begin in a ServoCalls message."""
    named = calls.call[np.isin(calls.call, WITH_TEXT)].tolist()
    return [dict(json.loads(text)) for call, text in zip(named, calls.texts, strict=False)
            if call == Call.START]


# Functions that return the rows of a message, by the name of its topic.
_READ: dict[str, Callable[[Any], list[Any]]] = {
    'image': _image,
    'contact': lambda message: [run.Contacts.row(message)],
    'servo_status': lambda message: [run.Statuses.row(message)],
    'sensor_pose': lambda message: [run.Poses.row(message)],
    'surface_contact': lambda message: [run.Poses.row(message)],
    'surface_patch': lambda message: [patch_from_msg(message)] if message.valid else [],
    'contour': lambda message: [run.xyz(pose.pose.position) for pose in message.poses],
    'sensor_info': lambda message: [sensor_info_from_msg(message)],
    'joint_states': lambda message: [message],
    'diagnostics': lambda message: [
        status.name.partition(':')[0].rpartition('/')[2] for status in message.status],
    'servo_calls': _goals}
_STAMPED = ('image', 'contact', 'servo_status', 'sensor_pose', 'surface_contact')
_THINNED = {*_STAMPED, 'surface_patch'} - {'servo_status'}  # a state may last one message only
_NEWEST = ('contour', 'sensor_info')  # only the newest message is needed


def _joint_acceleration(rows):
    """Return joint accelerations from the recorded velocities, or else from the positions."""
    if not rows:
        return np.empty((0, 0))
    names = rows[0].name
    states = [state for state in rows if state.name == names]
    stamps = np.array([stamp_to_ns(state.header.stamp) for state in states])
    times, new = np.unique(stamps, return_index=True)
    seconds = 1e-9 * (times - times[0])
    if all(len(states[k].velocity) == len(names) for k in new):
        velocities = np.array([states[k].velocity for k in new])
        return np.diff(velocities, axis=0) / np.diff(seconds)[:, None]
    return accelerations(seconds, np.array([states[k].position for k in new]))
