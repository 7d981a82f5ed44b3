"""A run read from its recording: messages to arrays."""
from array import array
from collections import defaultdict
from dataclasses import fields

import numpy as np

from edge_tracking.recording import run
from edge_tracking.recording.settings import Settings
from edge_tracking.recording.topics import RecordedTopics
from tactile_common.ros.bag_reader import Bag, Recorded
from tactile_common.ros.conversions import stamp_to_ns
from tactile_sensing.types.array import TactelArray
from tactile_servo.journal import Call, WITH_TEXT
from tactile_shape.conversions import patch_from_msg
from tactile_simulation.smoothness import accelerations

HELD = 1000  # messages of a topic, until they become columns
MOST = 60_000  # messages of a topic that are read, evenly; of the others the stamps alone
_COMPONENT_ZZ = 0


def read_run(path, namespace=None, *, joints=True) -> run.RunData:
    """
    Read a run from a rosbag2 recording: its folder, or one of its files.

    Without `joints` no joint states are read. ConfigurationError if there is no recording, or it
    holds several sensors and no namespace is chosen.
    """
    with Bag(path) as bag:
        topics = RecordedTopics(bag, namespace)
        wanted = {topic: name for topic, name in topics.name.items()
                  if name in _KEPT and (joints or name != 'joint_states')}
        every = {name: -(-bag.count(topic) // MOST) or 1 for topic, name in wanted.items()
                 if name in _THINNED}
        rows, parts, seen = defaultdict(list), defaultdict(list), defaultdict(int)
        stamps = {name: array('q') for name in _TABLES}
        start = None
        with bag.clear_errors():
            for row in bag.messages(wanted, raw=True):
                start, name = row.received_ns if start is None else start, wanted[row.topic]
                if name in stamps:
                    stamps[name].append(bag.stamp_ns(row))
                seen[name] += 1
                if (seen[name] - 1) % every.get(name, 1):
                    continue
                message = bag.unpacked(row)
                if name in _READ:
                    rows[name] += _READ[name](message)
                    continue
                if name in _NEWEST:
                    rows[name].clear()
                rows[name].append(Recorded(row.topic, row.received_ns, message))
                if len(rows[name]) == HELD and name in _TABLES:
                    parts[name].append(_table(bag, name, rows.pop(name)))
            tables = {name: _joined([*parts[name], _table(bag, name, rows[name])])
                      for name in _TABLES}
            return run.RunData(
                namespace=topics.prefix,
                start_ns=start or 0,
                images=tables['image'],
                contacts=tables['contact'],
                statuses=tables['servo_status'],
                poses=tables['sensor_pose'],
                contour=_contour(rows['contour']),
                patches=rows['surface_patch'],
                info=_info(rows['sensor_info']),
                nodes=frozenset(rows['diagnostics']),
                touches=tables['surface_contact'],
                joint_acceleration=_joint_acceleration(rows['joint_states']),
                stamps={name: np.asarray(known) for name, known in stamps.items()},
                every=every,
                goals=rows['servo_calls'],
                parameters=Settings.of(bag, topics).recorded,
            )


def _table(bag, name, rows):
    try:
        return _TABLES[name](rows)
    except AttributeError as error:
        raise bag.damaged(rows[0].topic, rows[0].received_ns, error) from error


def _joined(parts):
    """One table of several; of images, of those with the geometry of the first."""
    parts = [part for part in parts if len(part.stamp_ns)] or parts[:1]
    first = parts[0]
    if isinstance(first, run.Images):
        parts = [part for part in parts if part.frames.shape[1:] == first.frames.shape[1:]]
    return type(first)(**{item.name: np.concatenate([getattr(part, item.name) for part in parts])
                          if isinstance(getattr(first, item.name), np.ndarray)
                          else getattr(first, item.name) for item in fields(first)})


def _geometry(message):
    return TactelArray(message.rows, message.columns, message.pitch_x, message.pitch_y)


def _pressure(message):
    """Return the shallowest pressure layer of a picture, None if it has none that is whole."""
    layers = [layer for layer in message.layers if layer.component == _COMPONENT_ZZ
              and layer.stress.size == message.rows * message.columns > 0]
    return min(layers, key=lambda layer: layer.depth, default=None)


def _images(rows):
    kept, layers, array = [], [], None
    for row in rows:
        layer = _pressure(row.message)
        if layer is None:
            continue
        if array is None:
            array = _geometry(row.message)
        if (row.message.rows, row.message.columns) == array.shape:
            kept.append(row)
            layers.append(layer)
    shape = array.shape if array else (0, 0)
    frames = np.empty((len(kept), *shape), dtype=np.float32)
    for index, layer in enumerate(layers):
        frames[index] = layer.stress.reshape(shape)
    return run.Images.of(kept, frames=frames, array=array, unit=layers[0].unit if layers else '')


_TABLES = {'image': _images, 'contact': run.Contacts.of, 'servo_status': run.Statuses.of,
           'sensor_pose': run.Poses.of, 'surface_contact': run.Poses.of}
_THINNED = {*_TABLES, 'surface_patch'} - {'servo_status'}  # a state may be short
_NEWEST = ('contour', 'sensor_info')  # of which no other is needed


def _goals(calls):
    """Texts of the goals that begin in a ServoCalls message."""
    named = calls.call[np.isin(calls.call, WITH_TEXT)].tolist()
    return [text for call, text in zip(named, calls.texts, strict=False) if call == Call.START]


# What is kept of a message, of those that are not kept as they are.
_READ = {
    'diagnostics': lambda message: [
        status.name.partition(':')[0].rpartition('/')[2] for status in message.status],
    'servo_calls': _goals,
    'surface_patch': lambda message: [patch_from_msg(message)] if message.valid else []}
_KEPT = {*_TABLES, *_NEWEST, *_READ, 'joint_states'}


def _contour(rows):
    poses = rows[-1].message.poses if rows else []
    return np.array([run.xyz(pose.pose.position) for pose in poses]).reshape(-1, 3)


def _joint_acceleration(rows):
    """Of the velocities that joint states tell, else of their positions."""
    if not rows:
        return np.empty((0, 0))
    names = rows[0].message.name
    states = [row.message for row in rows if row.message.name == names]
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
    message = rows[-1].message
    return run.Info(sensor=message.sensor, array=_geometry(message),
                    acquisition_delay=float(message.acquisition_delay))
