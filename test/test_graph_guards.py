"""What the servo sees of the graph around it: who else publishes, goals in a hail, the clock."""

import time

import numpy as np
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient
from rclpy.qos import qos_profile_sensor_data
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from tactile_tests.graph import bench, half_rates
from trajectory_msgs.msg import JointTrajectory

from tactile_msgs.action import TrackEdge
from tactile_msgs.msg import Contact, ServoReason, ServoStatus, TactileImage

FORCE = 5.0  # N
TOPICS = {'image': TactileImage, 'contact': Contact, '/joint_states': JointState,
          '/joint_trajectory_controller/joint_trajectory': JointTrajectory}


@pytest.fixture(scope='module')
def it(tmp_path_factory):
    """Give the whole graph; each test leaves an idle servo."""
    with bench(parameters=half_rates(tmp_path_factory.mktemp('rates'))) as whole:
        yield whole.add_all()


def idle(it):
    """Wait for a servo that would take a goal."""
    it.wait(lambda: it.listener.state == ServoStatus.IDLE, 'idle')


@pytest.mark.parametrize('topic', TOPICS)
def test_a_second_publisher_holds_and_is_named(it, topic):
    listener = it.listener
    client = it.start_tracking(length=0.03, retreat=False)
    it.reach(0.0)
    rogue = listener.create_publisher(TOPICS[topic], topic, qos_profile_sensor_data)
    name = rogue.topic_name
    try:
        it.wait(lambda: listener.code == ServoReason.SEVERAL_PUBLISHERS, 'the hold')
        assert listener.state == ServoStatus.HOLD
        assert name in listener.reason and 'has 2' in listener.reason
        client.cancel()
        it.wait(lambda: client.finished, 'the end of the goal')
        it.remove('track')
        idle(it)
        refused = it.track(length=0.03)
        assert not refused.success and refused.reason_code == ServoReason.SEVERAL_PUBLISHERS
    finally:
        listener.destroy_publisher(rogue)
    it.wait(lambda: it.node('edge_servo').count_publishers(name) == 1, 'its end')


@pytest.mark.parametrize('change', [
    {'pitch_x': 1e-30}, {'rows': 8, 'columns': 8}, {'frame': 'map'}],
    ids=['pitch', 'shape', 'frame'])
def test_an_image_of_another_sensor_is_passed_over(it, change):
    idle(it)
    servo = it.node('edge_servo')
    heard = servo._on_image  # what the driver sends is changed on its way
    change = dict(change)
    frame = change.pop('frame', None)
    def replaced(raw):
        image = deserialize_message(raw, TactileImage)
        for name, value in change.items():
            setattr(image, name, value)
        if 'rows' in change:
            for layer in image.layers:
                layer.stress = np.zeros(64, np.float32)
        image.header.frame_id = frame or image.header.frame_id
        heard(serialize_message(image))

    (subscription,) = [s for s in servo.subscriptions if s.topic_name.endswith('/image')]
    callback, subscription.callback = subscription.callback, replaced
    try:
        client = it.start_tracking(length=0.01)
        it.wait(lambda: it.listener.state == ServoStatus.HOLD, 'a hold')
        code = ServoReason.WRONG_FRAME if frame else ServoReason.BAD_IMAGE
        it.wait(lambda: it.listener.code == code, 'the reason')
    finally:
        subscription.callback = callback
    client.cancel()
    it.wait(lambda: client.finished, 'the end of the goal')
    it.remove('track')


def test_every_goal_of_a_hail_gets_its_result(it):
    """390 goals a second, each cancelled as soon as it is accepted."""
    idle(it)
    listener, accepted, results, sent = it.listener, [], [], []
    client = ActionClient(listener, TrackEdge, 'track_edge')
    it.wait(client.server_is_ready, 'the server')

    def answered(future):
        handle = future.result()
        if handle.accepted:
            accepted.append(handle)
            handle.get_result_async().add_done_callback(
                lambda result: results.append(result.result()))
            handle.cancel_goal_async()

    def send():
        sent.append(client.send_goal_async(TrackEdge.Goal(speed=0.03, force=FORCE)))
        sent[-1].add_done_callback(answered)

    timer = listener.create_timer(1.0 / 390.0, send)
    it.wait(lambda: len(sent) >= 600, 'the hail')
    listener.destroy_timer(timer)
    it.wait(lambda: all(future.done() for future in sent), 'the answers')
    it.wait(lambda: len(results) == len(accepted), 'the results')
    idle(it)
    assert len(accepted) > 1
    assert {result.result.reason_code for result in results} == {ServoReason.CANCELLED}
    client.destroy()


def test_the_clock_cannot_be_changed_while_the_servo_runs(it):
    client = it.listener.create_client(SetParameters, 'edge_servo/set_parameters')
    it.wait(client.service_is_ready, 'the service')
    value = ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=True)
    future = client.call_async(SetParameters.Request(
        parameters=[Parameter(name='use_sim_time', value=value)]))
    it.wait(future.done, 'the answer')
    (result,) = future.result().results
    assert not result.successful and 'start' in result.reason
    before = it.listener.statuses[-1].header.stamp
    it.wait(lambda: it.listener.statuses[-1].header.stamp != before, 'time that goes on')
    assert abs(it.listener.statuses[-1].header.stamp.sec - time.time()) < 60.0


@pytest.mark.parametrize('seconds', [0.2, 1.2])
def test_a_controller_that_is_deactivated_is_noticed(it, seconds):
    idle(it)
    listener, robot = it.listener, it.robot.controller
    client = it.start_tracking(length=0.04, retreat=False)
    for progress in (0.005, 0.01, 0.015):
        it.reach(progress)
        begun = len(listener.statuses)
        robot.activate(False)
        it.graph.spin(lambda: False, seconds)
        robot.activate(True)
        it.wait(lambda: listener.offered, 'the offer to resume')
        held = {status.reason_code for status in listener.statuses[begun:]
                if status.state == ServoStatus.HOLD}
        if ServoReason.STALE_IMAGE not in held:
            break  # else the machine stalled: while the servo holds, nothing has to follow
    assert ServoReason.NOT_FOLLOWING in held
    place = listener.poses[-1].pose.position
    it.graph.spin(lambda: False, 0.5)
    after = listener.poses[-1].pose.position
    assert np.linalg.norm([after.x - place.x, after.y - place.y, after.z - place.z]) < 1e-4
    it.finish(client)
    assert client.success, client.reason
    it.remove('track')
