"""
Make the golden recordings: `python3 -m tactile_tests.golden_bags FOLDER`.

The closed loop without ROS is recorded as the nodes are, by the same writer, from seeds.
"""
from dataclasses import replace
from pathlib import Path
from shutil import copytree
from tempfile import TemporaryDirectory
from typing import Any

from geometry_msgs.msg import PoseStamped
import numpy as np
from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from edge_tracking.recording.record_bag import BagWriter
from edge_tracking.recording.topics import topics
from edge_tracking.replay.one import describe, Options, replay_one
from edge_tracking.resources import share
from tactile_common.command_line import Parser
from tactile_common.parameter_file import ParameterFile
from tactile_common.ros.cdr import packed, unpacked
from tactile_common.ros.conversions import pose_to_msg, set_stamp, stamp_from_ns
from tactile_sensing.contact.estimator import EstimatorConfig
from tactile_sensing.conversions import (
    contact_to_msg,
    image_from_msg,
    image_to_msg,
    sensor_info_from_msg,
    sensor_info_to_msg,
)
from tactile_servo.config import ServoConfig
from tactile_servo.conversions import (
    joint_state_to_msg,
    journal_to_msg,
    status_to_msg,
    trajectory_to_msg,
)
from tactile_servo.journal import Call
from tactile_servo.laws.registry import law_for, law_named
from tactile_servo.laws.surface_goal import SurfaceGoal
from tactile_servo.robot_config import NodeConfig, robot_of
from tactile_servo.supervisor import Supervisor
from tactile_servo.types import EdgeGoal, Timing
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.scene import find_scene, load_scene

NAMESPACE, FRAME = 'tactile', 'tactile_pad'
START = np.radians([-22, 35, -172, 0, -48, -22])
HEIGHT = 5e-4  # m, of the pad above what it approaches
TOLD_EVERY, TAKEN_EVERY = 4, 50  # cycles between statuses; calls of a message
EDGE = EdgeGoal(0.03, 5.0, length=0.012)


def sent(message):
    """Message as it arrives: its numbers in single precision are that only then."""
    return unpacked(packed(message), type(message))


class RecordedSupervisor(Supervisor):
    """A supervisor whose inputs and outputs `write(name, message or bytes)` takes."""

    write: Any = None
    cycles, image, news = 0, None, None

    def see_sensor(self, sensor):
        self.write('sensor_info', sensor_info_to_msg(sensor))
        super().see_sensor(sensor)

    def see_joints(self, positions, stamp_ns, arrival):
        self.write('joint_states', joint_state_to_msg(
            stamp_from_ns(stamp_ns), self.inputs._robot.joint_names, positions,
            np.zeros_like(positions), JointState()))
        super().see_joints(positions, stamp_ns, arrival)
        pose = PoseStamped(pose=pose_to_msg(self.inputs.pose))
        set_stamp(pose.header.stamp, stamp_ns)
        pose.header.frame_id = self.inputs._robot.root_frame
        self.write('sensor_pose', pose)

    def see_image(self, image, arrival):
        self.image = image_to_msg(image)
        self.write('image', self.image)
        super().see_image(image, arrival)

    def see_contact(self, contact, stamp_ns, arrival):
        self.write('contact', contact_to_msg(contact, self.image, stamp_ns))
        super().see_contact(contact, stamp_ns, arrival)

    def cycle(self, now, now_ns):
        status, window = super().cycle(now, now_ns)
        self.cycles += 1
        if window is not None:
            self.write('joint_trajectory', trajectory_to_msg(window))
        news = status.state, status.reason
        if news != self.news or not self.cycles % TOLD_EVERY:
            self.news = news
            self.journal.add(Call.STATUS)
            message = status_to_msg(status, self.law.name, Timing(0.0, 0.0, 0.0, self.cycles, 0))
            set_stamp(message.header.stamp, now_ns)
            message.header.frame_id = FRAME
            self.write('servo_status', message)
        if len(self.journal.call) >= TAKEN_EVERY:
            self.write('servo_calls', journal_to_msg(self.journal.take(), now_ns, FRAME))
        return status, window


class RecordedSimulation(Simulation):
    """A simulation in which all passes through messages, into a new bag."""

    supervisor: Any
    servo: Any

    def __init__(self, path, scene, seed=0, law=None, self_test=False):
        self._writer, self.now = BagWriter(path, topics(NAMESPACE)), 1.0
        self.supervisor = lambda *arguments: self._made(*arguments)
        law, own = law_for(scene.action, law), scene.parameters()
        urdf = share('urdf', 'puma260.urdf').read_text()
        values = {'contact_estimator': {}, 'shape_estimator': {}, **own,
                  'edge_servo': {**own.get('edge_servo', {}), 'law': law,
                                 'robot_description': urdf, 'self_test': self_test}}
        for node, given in values.items():
            self._write('parameters', ParameterEvent(
                node=f'/{NAMESPACE}/{node}', new_parameters=[
                    Parameter(name, value=value).to_parameter_msg()
                    for name, value in given.items()]))

        def config(kind):
            return ParameterFile().config('', kind, values['edge_servo'])
        model, limits, box = robot_of(config(NodeConfig))
        super().__init__(
            scene, law, seed=seed, config=config(ServoConfig), robot=(model, limits),
            settings=config(law_named(law).law.config_type), seed_positions=START, workspace=box,
            estimator=ParameterFile().config('', EstimatorConfig, values['contact_estimator']))

    def _made(self, *arguments):
        servo = RecordedSupervisor(*arguments)
        servo.write = self._write
        return servo

    def _write(self, name, message):
        data = message if isinstance(message, bytes) else packed(message)
        self._writer.write(name, round(1e9 * self.now), data)

    def _tared(self):
        convert, info = super()._tared()
        return convert, sensor_info_from_msg(sent(sensor_info_to_msg(info)))

    def picture(self, pose):
        return image_from_msg(sent(image_to_msg(super().picture(pose))))

    def close(self):
        servo = self.servo
        self._write('servo_calls', journal_to_msg(servo.journal.take(), 0, FRAME))
        self._writer.close()


def drop_out(loop):
    """Lose the sensor for a time that a hold bridges."""
    loop.run(EDGE, 1.0, lambda status: status.progress > 2e-3)
    loop.sensor_alive = False
    loop.run(None, 0.15)
    loop.sensor_alive = True
    loop.run(None, 0.3)


def pause(loop):
    """Pause on the way, go on when asked, then cancel."""
    loop.run(EDGE, 1.0, lambda status: status.progress > 2e-3)
    loop.servo.pause(True, loop.now)
    loop.run(None, 0.2)
    loop.servo.pause(False, loop.now)
    loop.run(None, 0.2)
    loop.servo.cancel()
    loop.run(None, 0.2)


# Scene and what is changed of it, its seed, and what happens; a goal alone is worked on for a time
# [s].
CASES: dict[str, Any] = {
    'noise': ('noise', {}, 1, (EDGE, 0.6)),
    'drop_out': ('straight', {}, 2, drop_out),
    'saturation': ('straight', {'sensor': {'pa_per_count': 200.0}}, 3, (EDGE, 0.6)),
    'lost_contact': ('gap', {'start': {'s': 0.078}}, 4, (EdgeGoal(0.06, 5.0), 0.9)),
    'corner': ('course', {'start': {'s': 0.045}}, 5, (EdgeGoal(0.06, 5.0), 0.9)),
    'pause': ('real_skin', {}, 6, pause),
    'surface': ('surfaces/sphere_70', {}, 7, (SurfaceGoal(0.03, 2.0, length=0.01), 1.25))}
TESTED = {'surface'}  # with the press test: what is short is kept small


def make(name, path):
    """Make one of the `CASES`: its recording, completed by what a replay tells of it."""
    shipped, changes, seed, happening = CASES[name]
    scene: Any = load_scene(find_scene(shipped))
    scene = replace(scene, start=replace(scene.start, height=HEIGHT, **changes.get('start', {})),
                    sensor=replace(scene.sensor, **changes.get('sensor', {})))
    with TemporaryDirectory() as folder:
        loop = RecordedSimulation(
            Path(folder, 'bag'), scene, seed, self_test=name in TESTED)
        if callable(happening):
            happening(loop)
        else:
            loop.run(*happening)
        loop.close()
        result = replay_one(Path(folder, 'bag'), Options(out=Path(folder, 'all'), compare=''))
        if result.status:
            raise RuntimeError(describe(result))
        copytree(Path(folder, 'all', 'bag'), path)
    return loop


if __name__ == '__main__':
    parser = Parser(prog='golden_bags', description='Record the bags of test/golden again.')
    parser.add_argument('folder', type=Path, help='where they are written, a folder for each')
    folder = parser.parse_args().folder
    for each in CASES:
        done = make(each, folder / each)
        states = [cycle.status.state.name for cycle in done.log]
        print(each, f'{done.now - 1.0:.2f} s', {it: states.count(it) for it in states},
              done.log[-1].status.reason.text)
