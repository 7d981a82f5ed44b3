"""What goes wrong in the field: dead sensors and robots, noise on the line, nonsense on topics."""

import time

import numpy as np
import pytest
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from tactile_tests.graph import bench, half_rates, ROBOT, stamp_of

from tactile_msgs.msg import Contact, ServoReason, ServoStatus
from tactile_sensing.nodes.contact_estimator import ContactEstimatorNode
from tactile_sensing.nodes.driver import DriverNode
from tactile_servo.nodes.servo import EdgeServoNode
from tactile_simulation.nodes.mock_robot import MockRobotNode
from tactile_simulation.nodes.mock_sensor import MockSensorNode

HOLD_WITHIN = 0.15  # s, from the death of the sensor to a hold
STANDING = 1e-3  # rad/s, of every joint
SPEED = 0.03  # m/s
NAN, INF = float('nan'), float('inf')


def first_after(messages, instant, condition):
    """Return the stamp of the first message after an instant that fulfils a condition, or inf."""
    return next((stamp_of(m) for m in messages if stamp_of(m) >= instant and condition(m)), INF)


def stall(messages, begin, end):
    """Return how long the machine, not the servo, kept its cycles waiting in a time [s]."""
    stamps = [stamp_of(m) for m in messages]
    gaps = np.diff([begin] + [t for t in stamps if begin < t <= end])
    return gaps.max(initial=0.0)


def test_dead_sensor_means_hold_and_its_return_lets_tracking_go_on(
        running, record_testsuite_property):
    listener = running.listener
    client = running.start_tracking(length=0.04, speed=SPEED)
    running.reach(0.005)
    died = time.time()
    running.remove('mock_sensor')
    running.wait(lambda: listener.state == ServoStatus.HOLD, 'a hold', seconds=2.0)
    held = first_after(listener.statuses, died, lambda s: s.state == ServoStatus.HOLD)
    record_testsuite_property('time_to_hold', held - died)
    assert held - died < HOLD_WITHIN + stall(listener.statuses, died, held)
    assert listener.code == ServoReason.STALE_IMAGE
    # The last contact came a little after its picture.
    running.wait(lambda: not listener.statuses[-1].contact_fresh, 'stale contacts', seconds=2.0)

    def stands(state):
        return max(abs(v) for v in state.velocity) < STANDING

    running.wait(lambda: first_after(listener.joints, died, stands) < INF, 'a standstill', 2.0)
    stood = first_after(listener.joints, died, stands)
    record_testsuite_property('time_to_standstill', stood - died)
    assert stood - died < HOLD_WITHIN + stall(listener.statuses, died, stood)

    # Gone for longer than a hold may end by itself.
    running.wait(lambda: stamp_of(listener.statuses[-1]) - held > 0.6, 'time')
    assert not client.finished
    running.graph.add(MockSensorNode, port=str(running.port), scene=str(running.scene_path))
    running.wait(lambda: listener.offered, 'the offer to resume')
    answer = running.pause(False)
    assert answer.success, answer.message
    running.finish(client)
    assert client.success, client.reason
    # While the machine keeps the servo waiting, the pad goes on.
    late = SPEED * stall(listener.statuses, died, INF)
    assert 0.039 < client.result.tracked_length < 0.041 + late
    assert running.refused == running.robot.controller.limit_violations == 0


def test_pause_holds_and_resumes(running):
    client = running.start_tracking(length=0.02)
    running.reach(0.005)
    assert running.pause(True).success
    running.wait(lambda: running.listener.state == ServoStatus.HOLD, 'a hold')
    assert running.listener.code == ServoReason.PAUSED
    assert running.pause(False).success
    running.finish(client)
    assert client.success, client.reason


def test_silent_robot_means_hold_and_in_the_end_an_abort(tmp_path):
    with bench(parameters=half_rates(tmp_path)) as it:
        graph, listener = it.graph, it.listener
        graph.add(MockSensorNode, port=str(it.port), scene=str(it.scene_path))
        graph.add(MockRobotNode, namespace='', scene=str(it.scene_path),
                  robot_description=str(ROBOT))
        graph.add(DriverNode, port=str(it.port))
        graph.add(ContactEstimatorNode)
        graph.add(EdgeServoNode, robot_description=str(ROBOT), **{'hold.give_up': 0.5})
        client = it.start_tracking()
        it.reach(0.005)
        died = time.time()
        it.remove('mock_robot')
        it.wait(lambda: listener.state == ServoStatus.HOLD, 'a hold', seconds=2.0)
        held = first_after(listener.statuses, died, lambda s: s.state == ServoStatus.HOLD)
        assert held - died < HOLD_WITHIN + stall(listener.statuses, died, held)
        # To destroy a node keeps this process for a while: images may have come late first.
        it.wait(lambda: listener.code == ServoReason.STALE_JOINT_STATE, 'its reason', seconds=0.4)
        assert not listener.statuses[-1].joints_fresh
        it.wait(lambda: client.finished, 'the end of the goal')
        assert not client.success
        assert client.result.reason_code == ServoReason.GAVE_UP
        assert client.reason == 'gave up: joint state is stale'


def a_contact(it, **fields):
    """Return a line contact as an estimator would publish it now, with fields replaced."""
    contact = Contact(
        type=Contact.TYPE_LINE, valid=True, force_valid=True, method='fit', model='line/zz',
        x=0.0, y=0.0, yaw=0.0, normal_force=5.0, line_force=197.0, snr=40.0, residual=1.0)
    contact.moments = np.array([5.0, 0.0, 0.0, 1e-5, 2.7e-4, 0.0])
    contact.header.stamp = it.listener.get_clock().now().to_msg()
    contact.header.frame_id = 'tactile_pad'
    for name, value in fields.items():
        setattr(contact, name, value)
    return contact


def wrong_frame(it):
    contact = a_contact(it, x=0.005)
    contact.header.frame_id = 'map'
    return contact


def stamped(it, seconds):
    contact = a_contact(it, x=0.005)
    contact.header.stamp.sec += seconds
    return contact


EVIL_CONTACTS = {
    'unknown_type': lambda it: a_contact(it, type=99),
    'unknown_reasons': lambda it: a_contact(it, valid=False, reasons=0xFFFFFFFF),
    'not_a_number': lambda it: a_contact(
        it, x=NAN, y=NAN, yaw=NAN, normal_force=NAN, moments=np.full(6, NAN)),
    'infinite': lambda it: a_contact(
        it, x=INF, y=INF, normal_force=INF, moments=np.full(6, INF)),
    'huge': lambda it: a_contact(
        it, x=1e300, yaw=0.9, normal_force=1e300, moments=np.full(6, 1e300)),
    'negative_force': lambda it: a_contact(it, normal_force=-1e9, moments=-np.ones(6)),
    'other_with_mad_moments': lambda it: a_contact(
        it, type=Contact.TYPE_OTHER, valid=False,
        moments=np.array([1e-300, 1.0, 1.0, 1e300, -1e300, 1.0])),
    'wrong_frame': wrong_frame,
    'from_the_past': lambda it: stamped(it, -1000),
    'from_the_future': lambda it: stamped(it, 1000),
}


@pytest.fixture(scope='module')
def nonsense(tmp_path_factory):
    """Give the whole graph with publishers of nonsense; one for all kinds, since it lasts."""
    with bench(parameters=half_rates(tmp_path_factory.mktemp('rates'))) as it:
        # The servo would refuse a second publisher; here what it says is to be judged.
        it.add_all(shared_topics=['contact', '/joint_states'])
        listener = it.listener
        it.contact = listener.create_publisher(Contact, 'contact', qos_profile_sensor_data)
        it.joint_state = listener.create_publisher(
            JointState, '/joint_states', qos_profile_sensor_data)
        it.direction = -1
        it.wait(lambda: it.contact.get_subscription_count() >= 2, 'discovery')
        yield it


def survive(it, publish, count=40):
    """Track while nonsense is published on top of the truth; whatever comes, keep the bounds."""
    listener = it.listener
    begin = len(listener.poses)
    it.direction = -it.direction
    client = it.start_tracking(length=0.01, direction=it.direction, retreat=False)
    sent = []

    def send():
        if len(sent) < count:
            sent.append(publish())

    try:
        it.reach(0.001)
        timer = listener.create_timer(0.004, send)
        it.wait(lambda: len(sent) == count, 'the nonsense')
        listener.destroy_timer(timer)
        seen = len(listener.statuses)
        it.wait(lambda: len(listener.statuses) > seen + 20, 'further cycles')
        it.finish(client)
    finally:
        client.cancel()
        it.remove('track')
        it.wait(lambda: listener.state == ServoStatus.IDLE, 'idle')

    positions = np.array([[p.pose.position.x, p.pose.position.y, p.pose.position.z]
                          for p in listener.poses[begin:]])
    assert np.isfinite(positions).all()
    assert (positions > [0.15, -0.3, 0.05]).all() and (positions < [0.45, 0.3, 0.35]).all()
    # Never deeper than where 5 N are met, 1 mm, and the bound on pressing on, 3 mm.
    assert positions[:, 2].min() > 0.15 - 0.0045
    lateral, _ = it.scene.edge.nearest(positions)
    assert np.abs(lateral).max() < 0.0127  # the edge never left the pad
    assert it.refused == 0
    assert it.robot.controller.limit_violations == 0


@pytest.mark.parametrize('kind', EVIL_CONTACTS)
def test_nonsense_on_contact_neither_crashes_nor_runs_away(nonsense, kind):
    def publish():
        nonsense.contact.publish(EVIL_CONTACTS[kind](nonsense))

    survive(nonsense, publish)


EVIL_JOINTS = {
    'not_a_number': {'position': [NAN] * 6},
    'huge': {'position': [1e300] * 6},
    'too_few': {'position': [0.0]},
    'unknown_names': {'name': list('abcdef'), 'position': [0.0] * 6},
    'empty': {'name': [], 'position': []},
}


@pytest.mark.parametrize('kind', EVIL_JOINTS)
def test_nonsense_on_joint_states_neither_crashes_nor_runs_away(nonsense, kind):
    names = nonsense.robot.robot.joint_names

    def publish():
        message = JointState(**{'name': list(names), **EVIL_JOINTS[kind]})
        message.header.stamp = nonsense.listener.get_clock().now().to_msg()
        nonsense.joint_state.publish(message)

    survive(nonsense, publish)
