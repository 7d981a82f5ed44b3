"""What happens to the pad and to the goal when a node is stopped or dies in the middle of it."""

import os
import signal
import time

import numpy as np
import pytest

WHY = 'launch_pytest is not installed: it comes with ROS 2, not as a wheel'
pytest.importorskip('launch_pytest', reason=WHY)
pytest.importorskip('launch_ros', reason=WHY)

# Only where launch is installed.
from tactile_tests.graph import bench, ROBOT, stamp_of  # noqa: E402, I100, I202
from tactile_tests.launching import DEADLINE, launched, parameters  # noqa: E402, I100, I202

from edge_tracking.track import Exit  # noqa: E402, I100, I202
from tactile_msgs.msg import ServoReason, ServoStatus  # noqa: E402, I100, I202
from tactile_servo.motion.robot import RobotModel  # noqa: E402, I100, I202
from tactile_simulation.edge_world import EdgeWorld  # noqa: E402, I100, I202

FORCE = 5.0  # N
GIVE_UP = 10.0  # s


class Interrupted:
    """A launch whose nodes are started again, with a bench that listens and sends goals."""

    def __init__(self, launch, graph):
        self.launch, self.bench, self.listener = launch, graph, graph.listener
        self._begin = 0

    def goal(self, **goal):
        """Send a goal and wait until a little of it has been tracked; returns its client."""
        self.bench.wait(lambda: self.listener.state == ServoStatus.IDLE, 'idle', DEADLINE)
        # A node that was killed is only missed when its lease is over.
        self.bench.wait(lambda: all(self.listener.count_publishers(topic) == 1 for topic in (
            'image', 'contact', '/joint_states')), 'one source of everything', DEADLINE)
        # While launch is waited for nothing is spun that would say that the client lives.
        client = self.bench.start_tracking(wait=DEADLINE, client_timeout=0.0, **goal)
        self.bench.reach(0.005)
        self._begin = len(self.listener.joints)
        return client

    def signal(self, name, number):
        """Send a signal to a node's process; returns how often the node has been started."""
        os.kill(self.launch.pid(name), number)
        return len(self.launch.found(rf'\[{name}-\d+\]: process started'))

    def restarted(self, name, times):
        self.launch.wait(rf'\[{name}-\d+\]: process started', times + 1)

    def ended(self, client):
        """Wait for the end of a goal, resume where that is offered; check the robot's way."""
        self.bench.finish(client)
        self.bench.remove('track')
        self.check()

    def check(self):
        """Compare the joints' speed and the force since the goal was tracked with their bounds."""
        robot = RobotModel.from_urdf(str(ROBOT), 'tactile_pad')
        renderer = EdgeWorld(self.bench.scene)
        states = self.listener.joints[self._begin:]
        speeds = np.array([state.velocity for state in states])
        assert (np.abs(speeds) <= robot.velocity_limit).all()
        force = max(renderer.force(robot.pose(np.array(state.position))) for state in states[::5])
        assert force < 1.5 * FORCE


@pytest.fixture(scope='module')
def it(tmp_path_factory):
    """Give a launch for all the tests of this module; each leaves a servo that is idle."""
    path = parameters(tmp_path_factory.mktemp('launch'), **{'hold.give_up': GIVE_UP})
    with launched('use_respawn:=true', 'start:=false', f'params_file:={path}') as launch, \
            bench() as graph:
        launch.wait('frames arrive')
        yield Interrupted(launch, graph)


def test_a_servo_that_stood_still_holds_and_goes_on_when_asked(it):
    client = it.goal(length=0.03)
    it.signal('edge_servo', signal.SIGSTOP)
    it.bench.graph.spin(lambda: False, 1.0)
    back = time.time()
    it.signal('edge_servo', signal.SIGCONT)
    it.bench.wait(lambda: it.listener.offered, 'the offer to resume')
    since = [status for status in it.listener.statuses if stamp_of(status) > back]
    assert {status.state for status in since} == {ServoStatus.HOLD}
    assert ServoReason.STALLED in {status.reason_code for status in since}
    it.ended(client)
    assert client.success, client.reason


def test_an_estimator_that_ends_does_no_harm(it):
    client = it.goal(length=0.03)
    times = it.signal('contact_estimator', signal.SIGTERM)
    it.restarted('contact_estimator', times)
    it.ended(client)
    assert client.success, client.reason


def test_a_driver_that_ends_does_no_harm_for_the_pad_has_lifted_off_meanwhile(it):
    client = it.goal(length=0.03)
    times, tared = it.signal('driver', signal.SIGTERM), len(it.launch.found('tared, noise'))
    it.bench.wait(lambda: it.listener.state == ServoStatus.HOLD, 'a hold')
    it.restarted('driver', times)
    it.ended(client)
    assert client.success, client.reason
    assert len(it.launch.found('tared, noise')) > tared


def test_a_robot_that_comes_back_elsewhere_moves_only_when_asked(it):
    client = it.goal()
    times = it.signal('mock_robot', signal.SIGKILL)
    it.bench.wait(lambda: it.listener.state == ServoStatus.HOLD, 'a hold')
    it.restarted('mock_robot', times)
    gone, back = time.time(), len(it.listener.joints)
    it.bench.wait(lambda: len(it.listener.joints) > back, 'joint states')
    it.bench.wait(lambda: client.finished or it.listener.offered, 'the offer, or the end')
    since = [status for status in it.listener.statuses if stamp_of(status) > gone]
    assert {status.state for status in since} <= {
        ServoStatus.HOLD, ServoStatus.DONE, ServoStatus.IDLE}
    there = np.array([state.position for state in it.listener.joints[back:]])
    assert np.ptp(there, axis=0).max() < 1e-6
    it.ended(client)


def test_a_servo_that_is_stopped_tells_its_client(it):
    client = it.goal()
    times = it.signal('edge_servo', signal.SIGINT)
    it.ended(client)
    assert client.reason_code == ServoReason.SHUTDOWN, client.reason
    it.restarted('edge_servo', times)
    it.launch.wait(r'edge_servo-\d+\]: process has finished cleanly')


def test_a_servo_that_dies_leaves_a_client_that_knows(it):
    client = it.goal()
    times = it.signal('edge_servo', signal.SIGKILL)
    it.bench.wait(lambda: client.finished, 'the end of the goal')
    assert client.exit in (Exit.SILENT, Exit.NOT_TRACKED), client.reason
    it.restarted('edge_servo', times)
    it.bench.remove('track')
    it.check()
