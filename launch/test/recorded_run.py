"""A run made up for the tests, written as messages or put together as arrays."""

from functools import cache

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, WrenchStamped
from nav_msgs.msg import Path
import numpy as np
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import StoragePlugin, Writer
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from tactile_common.ros.conversions import stamp_from_ns
from tactile_common.ros.message_definitions import definition_of
from tactile_msgs.msg import Contact, SensorInfo, ServoStatus, TactileImage
from tactile_sensing.conversions import contact_to_msg, image_to_msg, sensor_info_to_msg
from tactile_sensing.image import image_moments
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact as ContactData
from tactile_sensing.types.contact import ContactType, Reason
from tactile_sensing.types.image import Layer
from tactile_sensing.types.image import SensorInfo as SensorInfoData
from tactile_sensing.types.image import TactileImage as ImageData
from tactile_servo.reasons import ReasonCode
from tactile_simulation.edge_path import EdgePath
from tactile_simulation.edge_world import EdgeScene, EdgeWorld, Start
from tactile_simulation.sensor import SceneSkin, Sensor

NS = 1_000_000_000
START = 1_700_000_000 * NS
ARRAY = TactelArray(16, 16, 0.0254 / 16, 0.0254 / 16)
DELAY = 0.0025  # s, from mid-acquisition to the last byte
LATENCY = 0.001  # s, from the last byte to the end of the control cycle
CPU_TIME = 2e-4  # s
SPEED, FORCE, OFFSET = 0.03, 5.0, 0.003
APPROACH, TRACK, RETREAT = 0.4, 3.0, 0.4  # s
JOINTS = tuple(f'joint{number}' for number in range(1, 7))
ENDED = 'the edge ended'
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TOPICS = [
    ('/tactile/image', TactileImage, qos_profile_sensor_data),
    ('/tactile/sensor_info', SensorInfo, LATCHED),
    ('/tactile/contact', Contact, qos_profile_sensor_data),
    ('/tactile/wrench', WrenchStamped, qos_profile_sensor_data),
    ('/tactile/servo_status', ServoStatus, QoSProfile(depth=10)),
    ('/tactile/sensor_pose', PoseStamped, qos_profile_sensor_data),
    ('/diagnostics', DiagnosticArray, QoSProfile(depth=10)),
    ('/joint_states', JointState, QoSProfile(depth=10)),
    ('/joint_trajectory_controller/joint_trajectory', JointTrajectory, QoSProfile(depth=1)),
    ('/tactile/contour', Path, LATCHED),
]
CONTOUR_OFF = 2e-5  # m to the left of the edge


def with_columns(table, **columns):
    """Return a copy of records with columns replaced."""
    table = table.copy()
    for name, values in columns.items():
        table[name] = values
    return table


def straight_scene():
    """Edge of 200 mm along base y, the pad 3 mm beside it."""
    return EdgeScene(
        'straight', 'Straight edge.',
        EdgePath(np.array([[0.3, -0.1, 0.12], [0.3, 0.1, 0.12]])),
        Start(0.02, OFFSET, 0.004, 0.0), skin=SceneSkin(0.002, 2e5),
        sensor=Sensor(630.0, 10.0, 627.45))


def lateral_at(seconds):
    """Distance of the pad's centre to the left of the edge [m]: decays after contact."""
    return OFFSET * np.exp(-np.maximum(seconds - APPROACH, 0.0) / 0.05) + 1e-5 * np.sin(
        20.0 * seconds)


def depth_at(scene, seconds):
    """Indentation of the skin [m]: touches at the end of the approach, then 5 N."""
    full = FORCE / (scene.skin.stiffness * ARRAY.size_y)
    pressed = full * (1.0 - np.exp(-np.maximum(seconds - APPROACH, 0.0) / 0.05))
    above = scene.start.height * np.maximum(1.0 - seconds / APPROACH, 0.0)
    lifted = 0.01 * np.maximum(seconds - APPROACH - TRACK, 0.0) / RETREAT
    return pressed - above - lifted


def pose_at(scene, seconds):
    """Transform sensor -> base at a time since the start [s]."""
    pose = scene.start_pose()
    moving = np.clip(seconds - APPROACH, 0.0, TRACK)
    pose[:3, 3] = [
        0.3 - lateral_at(seconds), -0.1 + scene.start.s + SPEED * moving,
        0.12 - depth_at(scene, seconds)]
    return pose


def state_at(seconds):
    """State of the servo at a time since the start [s], and its reason."""
    if seconds < APPROACH:
        return ServoStatus.APPROACH, 'goal accepted'
    if seconds < APPROACH + TRACK:
        return ServoStatus.TRACK, 'contact'
    if seconds < APPROACH + TRACK + RETREAT:
        return ServoStatus.RETREAT, ENDED
    return ServoStatus.DONE, ENDED


def messages(scene):
    """Yield (topic, time of reception [ns], message) of the whole run."""
    renderer, rng = EdgeWorld(scene), np.random.default_rng(1)
    layer = Layer('zz', scene.skin.depth, np.empty((0, 0)), 160e3, 630.0, 'Pa')
    yield '/tactile/sensor_info', START, sensor_info_to_msg(SensorInfoData(
        START, 'tactile_pad', 'pad', 'flexitac', '', ARRAY, 200.0, DELAY, 2e5, 12.0, (layer,), (),
        'flexitac_16x16', START))
    yield '/diagnostics', START, DiagnosticArray(status=[DiagnosticStatus(
        name='driver: stream', level=b'\x01', message='late',
        values=[KeyValue(key='lost', value='3')])])
    end = APPROACH + TRACK + RETREAT + 0.02
    for k in range(int(end * 200)):
        stamp = START + k * NS // 200
        yield from _picture(scene, renderer, rng, k, stamp)
    for k in range(int(end * 400)):
        yield from _cycle(scene, START + k * NS // 400)
    for length in (0.02, SPEED * TRACK):  # m; the newest counts
        yield '/tactile/contour', START + round(NS * (APPROACH + length / SPEED)), _contour(
            scene, length)


def _contour(scene, length):
    contour = Path()
    for s in scene.start.s + np.arange(0.0, length, 1e-3):
        pose = PoseStamped()
        p = pose.pose.position
        p.x, p.y, p.z = 0.3 - CONTOUR_OFF, -0.1 + float(s), 0.12
        contour.poses.append(pose)
    return contour


def _picture(scene, renderer, rng, sequence, stamp):
    seconds = 1e-9 * (stamp - START)
    pose = pose_at(scene, seconds)
    pressure = renderer.render(pose) + 630.0 * rng.standard_normal(ARRAY.shape)
    image = image_to_msg(ImageData(
        stamp, sequence, (Layer('zz', 0.002, pressure, 160e3, 630.0),), ARRAY, True,
        frame_id='tactile_pad', sensor='pad'))
    arrival = stamp + round(DELAY * NS)
    yield '/tactile/image', arrival + 100_000, image
    touching = depth_at(scene, seconds) > 1e-4
    found = {'x': -lateral_at(seconds), 'y': 0.0, 'yaw': 0.0, 'force_valid': True,
             'normal_force': renderer.force(pose), 'snr': 40.0} if touching else {}
    contact = contact_to_msg(ContactData(
        ContactType.LINE if touching else ContactType.NONE, touching,
        Reason(0) if touching else Reason.NO_CONTACT, 'fit', 'line/zz',
        moments=image_moments(pressure, ARRAY, threshold=2000.0), **found),
        image, arrival + 300_000)
    yield '/tactile/contact', arrival + 350_000, contact
    wrench = WrenchStamped(header=image.header)
    wrench.wrench.force.z = -renderer.force(pose)
    yield '/tactile/wrench', arrival + 360_000, wrench


def _cycle(scene, time):
    seconds = 1e-9 * (time - START)
    state, reason = state_at(seconds)
    # Commands are sent LATENCY after the last byte of the newest picture.
    ready = round((DELAY + LATENCY) * NS)
    picture = START + (time - START) // (NS // 200) * (NS // 200)
    stamp = time + ready - round(CPU_TIME * NS)
    progress = SPEED * float(np.clip(seconds - APPROACH, 0.0, TRACK))
    tracking = state == ServoStatus.TRACK
    status = ServoStatus(
        controller='resolved_rate', state=state, reason=reason,
        reason_code=ReasonCode.EDGE_ENDED if reason == ENDED else ReasonCode.NONE,
        contact_stamp=stamp_from_ns(picture), contact_fresh=True, joints_fresh=True,
        lateral_error=-lateral_at(seconds) if tracking else float('nan'), angle_error=0.0,
        normal_force=FORCE if tracking else 0.0, force_target=FORCE,
        speed=SPEED if tracking else 0.0, progress=progress, limit_scale=1.0,
        manipulability=0.05, latency=DELAY + LATENCY, cpu_time=CPU_TIME,
        cycles=1000 + (time - START) * 400 // NS, missed_cycles=7 + (seconds > 1.0))
    status.header.stamp = stamp_from_ns(stamp)
    yield '/tactile/servo_status', stamp + 50_000, status
    pose = PoseStamped()
    pose.header.stamp, pose.header.frame_id = status.header.stamp, 'base_link'
    matrix = pose_at(scene, seconds)
    p, q = pose.pose.position, pose.pose.orientation
    p.x, p.y, p.z = map(float, matrix[:3, 3])
    # Half a turn about base y + x: pad x = -base x, pad y = base y, pad z = -base z.
    q.x, q.y, q.z, q.w = 0.0, 1.0, 0.0, 0.0
    yield '/tactile/sensor_pose', stamp + 60_000, pose
    joints = JointState(name=list(JOINTS), position=[0.1 * seconds] * 6)
    joints.header.stamp = status.header.stamp
    yield '/joint_states', stamp + 40_000, joints
    command = JointTrajectory(joint_names=list(JOINTS), points=[
        JointTrajectoryPoint(positions=[0.1 * seconds] * 6, velocities=[0.0] * 6)])
    command.points[0].time_from_start.nanosec = 80_000_000
    yield '/joint_trajectory_controller/joint_trajectory', stamp + 55_000, command


@cache
def recorded():
    """Topic, time of reception [ns] and bytes of every message of the run, in order."""
    rows = sorted(messages(straight_scene()), key=lambda row: row[1])
    return [(topic, received, serialize_message(message)) for topic, received, message in rows]


def write_bag(path, *, topics=TOPICS, storage=StoragePlugin.MCAP, rename=str):
    """Write the run as a bag, with the definitions that the recorder would write; its path."""
    with Writer(path, version=9, storage_plugin=storage) as writer:
        connections = {}
        for name, message_class, _ in topics:
            kind, definition, digest = definition_of(message_class)
            connections[name] = writer.add_connection(
                rename(name), kind, msgdef=definition, rihs01=digest)
        for name, received, data in recorded():
            if name in connections:
                writer.write(connections[name], received, data)
    return path
