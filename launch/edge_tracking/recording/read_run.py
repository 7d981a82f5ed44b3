"""A run read from its recording: messages to arrays."""

from collections import defaultdict

import numpy as np

from edge_tracking.recording.bag import open_bag
from edge_tracking.recording.run import (
    Commands,
    Contacts,
    Diagnostics,
    Images,
    Info,
    Joints,
    Poses,
    RunData,
    Statuses,
    Wrenches,
)
from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.ros.conversions import pose_from_msg
from tactile_sensing.types.array import TactelArray
from tactile_shape.conversions import patch_from_msg

DEFAULT_NAMESPACE = '/tactile'
TRAJECTORY_TOPIC = '/joint_trajectory_controller/joint_trajectory'
_COMPONENT_ZZ = 0


def read_run(path, namespace=None) -> RunData:
    """
    Read a run from a rosbag2 recording.

    Parameters
    ----------
    path : str or os.PathLike
        Folder of the recording, or one of its files.
    namespace : str, optional
        Namespace of the sensor; the one in the recording if missing.

    Raises
    ------
    ConfigurationError
        There is no such recording, or it holds several sensors and none is chosen.
    """
    with open_bag(path) as bag:
        prefix = _namespace(bag.topics, namespace, path)
        topics = {f'{prefix}/{name}': name for name in (
            'image', 'sensor_info', 'contact', 'wrench', 'servo_status', 'sensor_pose',
            'contour', 'surface_patch', 'diagnostics')}
        topics |= {'/joint_states': 'joint_states', TRAJECTORY_TOPIC: 'trajectory'}
        expected = {topic: name for topic, name in topics.items()
                    if bag.topics.get(topic) == _TYPES[name]}
        rows = defaultdict(list)
        start = None
        for topic, received, message in bag.messages(expected):
            start = received if start is None else start
            rows[expected[topic]].append((received, message))
    return RunData(
        namespace=prefix,
        start_ns=start or 0,
        images=_images(rows['image']),
        contacts=_columns(Contacts, rows['contact'], _CONTACT),
        wrenches=_columns(Wrenches, rows['wrench'], _WRENCH),
        statuses=_columns(Statuses, rows['servo_status'], _STATUS),
        poses=_columns(Poses, rows['sensor_pose'], _POSE),
        joints=_joints(rows['joint_states']),
        commands=_commands(rows['trajectory']),
        diagnostics=_diagnostics(rows['diagnostics']),
        contour=_contour(rows['contour']),
        patches=[patch_from_msg(message) for _, message in rows['surface_patch']
                 if message.valid],
        info=_info(rows['sensor_info']),
    )


_TYPES = {
    'image': 'tactile_msgs/msg/TactileImage',
    'sensor_info': 'tactile_msgs/msg/SensorInfo',
    'contact': 'tactile_msgs/msg/Contact',
    'wrench': 'geometry_msgs/msg/WrenchStamped',
    'servo_status': 'tactile_msgs/msg/ServoStatus',
    'sensor_pose': 'geometry_msgs/msg/PoseStamped',
    'contour': 'nav_msgs/msg/Path',
    'surface_patch': 'tactile_msgs/msg/SurfacePatch',
    'diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
    'joint_states': 'sensor_msgs/msg/JointState',
    'trajectory': 'trajectory_msgs/msg/JointTrajectory',
}


def _namespace(topics, wanted, path):
    if wanted is not None:
        return '/' + wanted.strip('/') if wanted.strip('/') else ''
    own = ('image', 'contact', 'servo_status')
    found = sorted({topic.rpartition('/')[0] for topic, kind in topics.items()
                    if any(topic.endswith(f'/{name}') and kind == _TYPES[name]
                           for name in own)})
    if len(found) <= 1:
        return found[0] if found else DEFAULT_NAMESPACE
    if DEFAULT_NAMESPACE in found:
        return DEFAULT_NAMESPACE
    raise ConfigurationError(
        f'bag {path}: holds several sensors, {", ".join(found)}; choose a namespace')


# --- messages to columns ------------------------------------------------------------------------

def _ns(stamp):
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def _stamp(message):
    return _ns(message.header.stamp)


def _xyz(vector):
    return vector.x, vector.y, vector.z


# Per field: type, shape of one value, and how to get it out of a message.
_CONTACT = {
    'stamp_ns': (np.int64, (), _stamp),
    'sequence': (np.int64, (), lambda m: m.sequence),
    'type': (np.int64, (), lambda m: m.type),
    'valid': (bool, (), lambda m: m.valid),
    'reasons': (np.int64, (), lambda m: m.reasons),
    **{name: (float, (), lambda m, name=name: getattr(m, name))
       for name in ('a', 'yaw', 'normal_force', 'snr')},
    'm0': (float, (), lambda m: m.moments[0]),
    'centre_of_pressure': (float, (2,), lambda m: _xyz(m.centre_of_pressure)[:2]),
    'latency': (float, (), lambda m: 1e-9 * _ns(m.latency)),
}
_WRENCH = {
    'stamp_ns': (np.int64, (), _stamp),
    'force': (float, (3,), lambda m: _xyz(m.wrench.force)),
    'torque': (float, (3,), lambda m: _xyz(m.wrench.torque)),
}
_STATUS = {
    'stamp_ns': (np.int64, (), _stamp),
    'controller': (object, (), lambda m: m.controller),
    'state': (np.int64, (), lambda m: m.state),
    'reason': (object, (), lambda m: m.reason),
    'contact_stamp_ns': (np.int64, (), lambda m: _ns(m.contact_stamp)),
    **{name: (float, (), lambda m, name=name: getattr(m, name))
       for name in ('lateral_error', 'angle_error', 'normal_force', 'force_target', 'speed',
                    'progress', 'limit_scale', 'manipulability', 'cycle_time')},
    'missed_cycles': (np.int64, (), lambda m: m.missed_cycles),
}
_POSE = {
    'stamp_ns': (np.int64, (), _stamp),
    'matrix': (float, (4, 4), lambda m: _matrix(m.pose)),
}


def _columns(kind, rows, fields):
    columns = {'received_ns': np.array([received for received, _ in rows], dtype=np.int64)}
    for name, (dtype, shape, get) in fields.items():
        values = np.empty((len(rows), *shape), dtype=dtype)
        for index, (_, message) in enumerate(rows):
            values[index] = get(message)
        columns[name] = values
    return kind(**columns)


def _matrix(pose):
    try:
        return pose_from_msg(pose)
    except TactileError:
        return np.full((4, 4), np.nan)


def _geometry(message):
    return TactelArray(message.rows, message.columns, message.pitch_x, message.pitch_y)


def _pressure(message):
    """Return the shallowest pressure layer of a picture, None if it has none that is whole."""
    layers = [layer for layer in message.layers if layer.component == _COMPONENT_ZZ
              and layer.stress.size == message.rows * message.columns > 0]
    return min(layers, key=lambda layer: layer.depth, default=None)


def _images(rows):
    kept, array, unit = [], None, ''
    for received, message in rows:
        layer = _pressure(message)
        if layer is None:
            continue
        if array is None:
            array, unit = _geometry(message), layer.unit
        if (message.rows, message.columns) == array.shape:
            kept.append((received, message, layer.stress))
    shape = array.shape if array else (0, 0)
    frames = np.empty((len(kept), *shape), dtype=np.float32)
    for index, (_, _, stress) in enumerate(kept):
        frames[index] = stress.reshape(shape)
    return Images(
        stamp_ns=np.array([_stamp(message) for _, message, _ in kept], dtype=np.int64),
        received_ns=np.array([received for received, _, _ in kept], dtype=np.int64),
        sequence=np.array([message.sequence for _, message, _ in kept], dtype=np.int64),
        frames=frames, array=array, unit=unit, skipped=len(rows) - len(kept))


def _joints(rows):
    names = tuple(rows[0][1].name) if rows else ()
    whole = [(received, message) for received, message in rows
             if tuple(message.name) == names and len(message.position) == len(names)]
    return _columns(
        lambda **columns: Joints(names=names, **columns), whole,
        {'stamp_ns': (np.int64, (), _stamp),
         'position': (float, (len(names),), lambda m: m.position)})


def _commands(rows):
    names = tuple(rows[0][1].joint_names) if rows else ()
    whole = [(received, message) for received, message in rows
             if tuple(message.joint_names) == names and message.points
             and all(len(p.positions) == len(names) for p in message.points)]
    shape = (len(names),)
    return _columns(
        lambda **columns: Commands(names=names, **columns), whole,
        {'first': (float, shape, lambda m: m.points[0].positions),
         'last': (float, shape, lambda m: m.points[-1].positions),
         'horizon': (float, (), lambda m: 1e-9 * _ns(m.points[-1].time_from_start))})


def _diagnostics(rows):
    flat = [(received, status) for received, message in rows for status in message.status]
    return _columns(Diagnostics, flat, {
        'name': (object, (), lambda status: status.name),
        'level': (np.int64, (), lambda status: status.level),
        'message': (object, (), lambda status: status.message),
        'values': (object, (), lambda status: {pair.key: pair.value for pair in status.values}),
    })


def _contour(rows):
    poses = rows[-1][1].poses if rows else []
    return np.array([_xyz(pose.pose.position) for pose in poses]).reshape(-1, 3)


def _info(rows):
    if not rows:
        return None
    message = rows[-1][1]
    layer = next((layer for layer in message.layers if layer.component == _COMPONENT_ZZ), None)
    return Info(
        sensor=message.sensor, model=message.model, array=_geometry(message),
        nominal_rate=float(message.nominal_rate),
        acquisition_delay=float(message.acquisition_delay),
        unit=layer.unit if layer else '', full_scale=layer.full_scale if layer else 0.0,
        noise_std=layer.noise_std if layer else 0.0, calibration=message.calibration,
        tared=_ns(message.tared_at) > 0)
