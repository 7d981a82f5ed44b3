"""A graph under test: a listener to its topics, waits with a deadline, and its geometry."""

from contextlib import contextmanager
from pathlib import Path
from typing import Any

from geometry_msgs.msg import PoseStamped
import numpy as np
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
import yaml

from edge_tracking.graph import (
    add_mocks,
    add_sensing,
    add_servo,
    calibrate,
    Graph,
    PARAMETERS,
    private_port,
)
from edge_tracking.resources import share
from edge_tracking.track import TrackNode
from tactile_common.ros.conversions import pose_from_msg, stamp_to_seconds
from tactile_msgs.msg import Contact, SensorInfo, ServoReason, ServoStatus, TactileImage
from tactile_servo.laws.registry import law_for
from tactile_simulation.scene import find_scene, load_scene

DEADLINE = 20.0  # s, of every wait; generous, since a loaded machine is no fault
ROBOT = share('urdf', 'puma260.urdf')
_DEEP = QoSProfile(depth=1000)
_SENSOR = QoSProfile(depth=1000, reliability=qos_profile_sensor_data.reliability)
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class ListenerNode(Node):
    """Keeps every message of a namespace, in lists in the order of arrival."""

    def __init__(self, **kwargs):
        super().__init__('listener', **kwargs)
        self.statuses = self.keep(ServoStatus, 'servo_status', _DEEP)
        self.contacts = self.keep(Contact, 'contact', _SENSOR)
        self.images = self.keep(TactileImage, 'image', _SENSOR)
        self.infos = self.keep(SensorInfo, 'sensor_info', _LATCHED)
        self.poses = self.keep(PoseStamped, 'sensor_pose', _SENSOR)
        self.joints = self.keep(JointState, '/joint_states', _SENSOR)
        self.logs = self.keep(Log, '/rosout', _DEEP)
        self.pause_client: Any = self.create_client(SetBool, 'edge_servo/pause')

    def keep(self, kind, topic, qos):
        """Return a list that takes every message of a topic."""
        kept: list[Any] = []
        self.create_subscription(kind, topic, kept.append, qos)
        return kept

    @property
    def tared(self):
        return bool(self.infos) and self.infos[-1].tared_at.sec > 0

    @property
    def state(self):
        return self.statuses[-1].state if self.statuses else None

    @property
    def reason(self):
        return self.statuses[-1].reason if self.statuses else ''

    @property
    def code(self) -> int | None:
        return self.statuses[-1].reason_code if self.statuses else None

    @property
    def offered(self) -> bool:
        """Whether the servo holds, could go on, and waits for a command to."""
        return (self.state, self.code) == (ServoStatus.HOLD, ServoReason.INPUT_BACK)

    def said(self, text):
        """Whether any node has logged a text that contains this one."""
        return any(text in log.msg for log in self.logs)


class Bench:
    """A graph with a listener; `listeners` are those to servos that are resumed when they hold."""

    def __init__(self, graph, port, scene='straight'):
        self.graph, self.port = graph, port
        self.scene_path = find_scene(scene)
        self.scene = load_scene(self.scene_path)
        self.robot: Any = None  # MockRobotNode
        self.listener = graph.add(ListenerNode)
        self.listeners = [self.listener]

    def add_all(self, **servo):
        """Add mocks, driver, estimator and servo, this with parameters of its own."""
        self.robot = add_mocks(self.graph, self.port, self.scene_path, ROBOT)
        add_sensing(self.graph, self.port, calibrate(self.port, self.scene))
        add_servo(self.graph, ROBOT, **{'law': law_for(self.scene.action), **servo})
        return self

    def node(self, name):
        return next(node for node in self.graph.nodes if node.get_name() == name)

    @property
    def refused(self):
        """Trajectories that the robot rejected, but for those of a loaded machine: late ones."""
        return self.robot.rejected - self.robot.late

    def remove(self, name):
        node = self.node(name)
        self.graph.nodes.remove(node)
        self.graph.executor.remove_node(node)
        # Its callbacks that are queued already must not meet a destroyed node.
        last = self.graph.executor.create_task(lambda: None)
        self.wait(last.done, 'the end of the queue')
        node.destroy_node()

    def wait(self, condition, what, seconds=DEADLINE):
        """Spin until a condition holds; AssertionError if it does not in time."""
        self.graph.spin(condition, seconds)
        assert condition(), (
            f'{what} did not come within {seconds:g} s; servo: {self.listener.state} '
            f'{self.listener.reason!r}; log: {[log.msg for log in self.listener.logs[-5:]]}')

    def start_tracking(self, **goal):
        return self.graph.add(TrackNode, action=self.scene.action, **goal)

    def track(self, **goal):
        client = self.start_tracking(**goal)
        self.finish(client)
        self.remove('track')
        return client

    def attend(self, done, what, seconds=2 * DEADLINE):
        """
        Wait for an event, and resume what holds.

        Where the machine stalls, a hold may not end by itself: it lasts too long, or the robot
        was late as well and did not follow.
        """
        def offered():
            return [listener for listener in self.listeners if listener.offered]

        self.wait(lambda: done() or offered(), what, seconds)
        while not done():
            for listener in offered():
                self.pause(False, listener)
                self.wait(lambda it=listener: done() or not it.offered, 'the end of the hold')
            self.wait(lambda: done() or offered(), what, seconds)

    def reach(self, progress, seconds=2 * DEADLINE):
        """Wait until the servo has tracked some way."""
        self.attend(lambda: self.listener.state == ServoStatus.TRACK
                    and self.listener.statuses[-1].progress >= progress, 'tracking', seconds)

    def finish(self, client):
        self.attend(lambda: client.finished, 'the end of the goal', 6 * DEADLINE)

    def pause(self, paused, listener=None):
        """Call ~/pause and return the answer."""
        client = (listener or self.listener).pause_client
        self.wait(client.service_is_ready, 'the service ~/pause')
        future = client.call_async(SetBool.Request(data=paused))
        self.wait(future.done, 'the answer of ~/pause')
        return future.result()

    def call(self, kind, service, **request):
        """Call a service of the graph and return its answer."""
        client = self.listener.create_client(kind, service)
        self.wait(client.service_is_ready, f'the service {service}')
        future = client.call_async(kind.Request(**request))
        self.wait(future.done, f'the answer of {service}')
        self.listener.destroy_client(client)
        return future.result()

    def insist(self, kind, service, **request):
        """Call a service until it agrees: where the machine stalls, inputs are stale meanwhile."""
        answers = [self.call(kind, service, **request)]

        def agrees():
            if not answers[-1].success:
                answers.append(self.call(kind, service, **request))
            return answers[-1].success

        self.graph.spin(agrees, DEADLINE)
        return answers[-1]

    def path(self):
        """Return stamps (N,) [s] and sensor poses (N, 4, 4) in the base frame so far."""
        poses = list(self.listener.poses)
        return (np.array([stamp_to_seconds(pose.header.stamp) for pose in poses]),
                np.array([pose_from_msg(pose.pose) for pose in poses]).reshape(-1, 4, 4))


def half_rates(folder: Path) -> Path:
    """Write the graph's parameters at half of their rates, for a machine that others use too."""
    parameters = yaml.safe_load(PARAMETERS.read_text('utf-8'))
    for node in parameters.values():
        node['ros__parameters']['rate'] *= 0.5
    path = folder / 'half_rates.yaml'
    path.write_text(yaml.safe_dump(parameters), 'utf-8')
    return path


@contextmanager
def bench(scene='straight', namespace='tactile', parameters=None, domain=None):
    """Give an empty graph with a listener; everything is gone afterwards."""
    own = load_scene(scene).parameters()
    with private_port() as port, Graph(parameters, namespace, domain, own) as graph:
        yield Bench(graph, port, scene)


def stamp_of(message):
    return stamp_to_seconds(message.header.stamp)
