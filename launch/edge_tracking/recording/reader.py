"""Reader of a run from its recording: converts messages to arrays."""
from array import array
from collections import Counter, defaultdict
from typing import Any

import numpy as np

from edge_tracking.recording import run
from edge_tracking.recording.settings import Settings
from edge_tracking.recording.topics import RecordedTopics
from tactile_common.ros.bag_reader import Bag
from tactile_common.ros.conversions import stamp_to_ns
from tactile_sensing.types.array import TactelArray
from tactile_servo.journal import Call, WITH_TEXT
from tactile_shape.conversions import patch_from_msg
from tactile_simulation.smoothness import accelerations

MOST = 60_000  # messages of a topic, evenly spaced, that are read; of others only the stamps
_COMPONENT_ZZ = 0


def read_run(path, namespace=None, *, joints=True) -> run.RunData:
    """
    Read a run from a rosbag2 recording: its folder, or one of its files.

    Without `joints` the joint states are not read. Raises a ConfigurationError if there is no
    recording, or if it contains several sensors and no namespace is given.
    """
    with Bag(path) as bag:
        topics = RecordedTopics(bag, namespace)
        wanted = {topic: name for topic, name in topics.name.items()
                  if name in _KEPT and (joints or name != 'joint_states')}
        every = {name: -(-bag.count(topic) // MOST) or 1 for topic, name in wanted.items()
                 if name in _THINNED}
        rows, seen = defaultdict(list), Counter()
        stamps = {name: array('q') for name in _STAMPED}
        start = None
        with bag.clear_errors():
            for row in bag.messages(wanted, raw=True):
                start, name = row.received_ns if start is None else start, wanted[row.topic]
                if name in stamps:
                    stamps[name].append(bag.stamp_ns(row))
                seen[name] += 1
                if (seen[name] - 1) % every.get(name, 1):
                    continue
                if name in _NEWEST:
                    rows[name].clear()
                rows[name] += _kept(bag, row, name)
            contacts, statuses, poses, touches = (
                table.of(rows[name]) for name, table in _TABLES.items())
            return run.RunData(
                namespace=topics.prefix,
                start_ns=start or 0,
                images=_images(rows['image']),
                contacts=contacts,
                statuses=statuses,
                poses=poses,
                contour=_contour(rows['contour']),
                patches=rows['surface_patch'],
                info=_info(rows['sensor_info']),
                nodes=frozenset(rows['diagnostics']),
                touches=touches,
                joint_acceleration=_joint_acceleration(rows['joint_states']),
                stamps={name: np.asarray(known) for name, known in stamps.items()},
                every=every,
                goals=rows['servo_calls'],
                parameters=Settings.of(bag, topics).recorded,
            )


def _kept(bag, row, name):
    """Return the stored values of a message; ConfigurationError if it lacks one of them."""
    message = bag.unpacked(row)
    try:
        if name in _TABLES:
            return [_TABLES[name].row(message)]
        return _READ[name](message) if name in _READ else [message]
    except AttributeError as error:
        raise bag.damaged(row.topic, row.received_ns, error) from error


def _pressure(message):
    """Return the shallowest complete pressure layer of an image; None if there is none."""
    layers = [layer for layer in message.layers if layer.component == _COMPONENT_ZZ
              and layer.stress.size == message.rows * message.columns > 0]
    return min(layers, key=lambda layer: layer.depth, default=None)


def _image(message):
    """Return a list with pressure, (unit, pitches) and columns of an image, or an empty list."""
    layer = _pressure(message)
    return [] if layer is None else [(
        layer.stress.reshape(message.rows, message.columns),
        (layer.unit, message.pitch_x, message.pitch_y), run.Images.row(message))]


def _images(rows):
    """Return the table of images that have the shape of the first one."""
    if not rows:
        return run.Images.of([], frames=np.empty((0, 0, 0), np.float32), array=None, unit='')
    first, (unit, *pitches), _ = rows[0]
    frames, _, kept = zip(*(row for row in rows if row[0].shape == first.shape), strict=True)
    return run.Images.of(kept, frames=np.array(frames, np.float32), unit=unit,
                         array=TactelArray(*first.shape, *pitches))


_TABLES: dict[str, Any] = {'contact': run.Contacts, 'servo_status': run.Statuses,
                           'sensor_pose': run.Poses, 'surface_contact': run.Poses}
_STAMPED = ('image', *_TABLES)
_THINNED = {*_STAMPED, 'surface_patch'} - {'servo_status'}  # a state may last one message only
_NEWEST = ('contour', 'sensor_info')  # only the newest message is needed


def _goals(calls):
    """Return the texts of the goals that begin in a ServoCalls message."""
    named = calls.call[np.isin(calls.call, WITH_TEXT)].tolist()
    return [text for call, text in zip(named, calls.texts, strict=False) if call == Call.START]


# Conversions of messages that are neither stored unchanged nor rows of a table.
_READ = {
    'image': _image,
    'diagnostics': lambda message: [
        status.name.partition(':')[0].rpartition('/')[2] for status in message.status],
    'servo_calls': _goals,
    'surface_patch': lambda message: [patch_from_msg(message)] if message.valid else []}
_KEPT = {*_STAMPED, *_NEWEST, *_READ, 'joint_states'}


def _contour(rows):
    poses = rows[-1].poses if rows else []
    return np.array([run.xyz(pose.pose.position) for pose in poses]).reshape(-1, 3)


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


def _info(rows):
    if not rows:
        return None
    message = rows[-1]
    array = TactelArray(message.rows, message.columns, message.pitch_x, message.pitch_y)
    return run.Info(sensor=message.sensor, array=array,
                    acquisition_delay=float(message.acquisition_delay))
