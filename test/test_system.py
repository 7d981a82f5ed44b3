"""The whole graph in one process, from sensor bytes to joint trajectories and back."""

from geometry_msgs.msg import PoseStamped
import numpy as np
import pytest
from rclpy.qos import qos_profile_sensor_data
from tactile_tests.graph import bench, half_rates, ROBOT, stamp_of

from edge_tracking.graph import private_port
from tactile_common.ros.conversions import pose_to_msg
from tactile_msgs.msg import Contact, ServoStatus
from tactile_sensing.nodes.contact_estimator import ContactEstimatorNode
from tactile_sensing.nodes.driver import DriverNode
from tactile_servo.nodes.servo import EdgeServoNode
from tactile_simulation.edge_world import EdgeWorld
from tactile_simulation.nodes.mock_robot import MockRobotNode
from tactile_simulation.nodes.mock_sensor import MockSensorNode
from tactile_simulation.scene import load_scene

LENGTH = 0.03  # m
SETTLED = 0.01  # m of way after which the bars hold
FORCE = 5.0  # N

SCENE = """
name: {name}
description: The straight edge, met at another place.
edge: {{start: [0.36, -0.08, 0.15], heading: 90, path: [{{straight: 0.2}}]}}
skin: {{depth: 0.002, stiffness: 200000.0}}
sensor: {{noise_std: 630.0, baseline: 10, pa_per_count: 627.45}}
start: {{s: 0.1, offset: {offset}, height: -0.001, yaw: {yaw}}}
"""


@pytest.fixture(scope='module')
def tracked(tmp_path_factory):
    """Track a short way once; the tests look at what happened, when the graph is gone."""
    with bench(parameters=half_rates(tmp_path_factory.mktemp('rates'))) as it:
        it.add_all()
        it.client = it.track(length=LENGTH)
        it.rate = it.node('edge_servo').get_parameter('rate').value
    return it


def settled(it):
    """Poses (N, 4, 4) while tracking, after the first 10 mm."""
    times, poses = it.path()
    statuses = [status for status in it.listener.statuses
                if status.state == ServoStatus.TRACK and status.progress >= SETTLED]
    inside = (times >= stamp_of(statuses[0])) & (times <= stamp_of(statuses[-1]))
    assert inside.sum() > 50
    return poses[inside]


def test_goal_succeeds_and_every_command_is_taken_as_it_is(tracked):
    client = tracked.client
    assert client.success, client.reason
    assert client.reason == 'length reached'
    assert client.result.tracked_length == pytest.approx(LENGTH, abs=1e-3)
    assert len(client.result.contour) > 10
    assert client.feedback.progress > 0.5 * LENGTH
    assert tracked.refused == 0
    assert tracked.robot.controller.limit_violations == 0


def test_pad_stays_over_the_true_edge_with_the_wanted_force(tracked):
    lateral, _ = tracked.scene.edge.nearest(settled(tracked)[:, :3, 3])
    assert np.sqrt(np.mean(lateral**2)) < 5e-5
    assert np.abs(lateral).max() < 3e-4
    renderer = EdgeWorld(tracked.scene)
    force = np.array([renderer.force(pose) for pose in settled(tracked)[::5]])
    assert force.mean() == pytest.approx(FORCE, rel=0.05)
    assert np.sqrt(np.mean((force - FORCE)**2)) < 0.1 * FORCE


def test_states_follow_in_order(tracked):
    S = ServoStatus
    states = [status.state for status in tracked.listener.statuses]
    # A loaded machine stalls now and then: the servo holds, and may approach again after that.
    first = [state for state in dict.fromkeys(states) if state != S.HOLD]
    assert first[:5] == [S.IDLE, S.APPROACH, S.TRACK, S.RETREAT, S.DONE]


def test_every_cycle_is_accounted_for(tracked):
    statuses = tracked.listener.statuses
    stamps = np.array([stamp_of(status) for status in statuses])
    assert np.all(np.diff(stamps) > 0)
    missed = statuses[-1].missed_cycles - statuses[0].missed_cycles
    cycles = tracked.rate * (stamps[-1] - stamps[0])
    # However loaded the machine: every cycle that was due has come or is told as missed, but for
    # those that wait up to .3 periods for pictures which such a machine brings unevenly.
    begun = statuses[-1].cycles - statuses[0].cycles
    assert begun + missed == pytest.approx(cycles, rel=0.15, abs=3)
    active = [s for s in statuses if s.state in (ServoStatus.APPROACH, ServoStatus.TRACK)]
    assert all(s.controller == 'trace' and s.reason for s in active)
    assert all(s.contact_fresh and s.joints_fresh for s in active)


def test_method_is_selected_by_a_parameter(tmp_path):
    with bench(parameters=half_rates(tmp_path)) as it:
        graph = it.graph
        graph.add(MockSensorNode, port=str(it.port), scene=str(it.scene_path))
        it.robot = graph.add(MockRobotNode, namespace='', scene=str(it.scene_path),
                             robot_description=str(ROBOT))
        graph.add(DriverNode, port=str(it.port))
        graph.add(ContactEstimatorNode, method='moments')
        graph.add(EdgeServoNode, robot_description=str(ROBOT))
        client = it.track(length=LENGTH)
        assert client.success, client.reason
        lines = [c for c in it.listener.contacts if c.type == Contact.TYPE_LINE and c.valid]
        assert lines and {c.method for c in lines} == {'moments'}
        lateral, _ = it.scene.edge.nearest(settled(it)[:, :3, 3])
        assert np.abs(lateral).max() < 1e-3  # the thesis' bar
        assert it.refused == 0


def test_a_pad_of_another_size_needs_no_more_than_its_scene(tmp_path):
    """24 columns every 1.0 mm and 12 rows every 1.5 mm; driver and servo hear of it."""
    scene = tmp_path / 'oblong.yaml'
    scene.write_text(SCENE.format(name='oblong', offset=0.003, yaw=0).replace(
        'sensor: {', 'sensor: {rows: 12, columns: 24, pitch_x: 0.001, pitch_y: 0.0015, ').replace(
        's: 0.1', 's: 0.05').replace('height: -0.001', 'height: 0.004'))
    with bench(str(scene), 'oblong', half_rates(tmp_path)) as it:
        it.add_all()
        client = it.track(length=LENGTH)
        assert client.success, client.reason
        info, image = it.listener.infos[-1], it.listener.images[-1]
        for message in (info, image):
            assert (message.rows, message.columns) == (12, 24)
            assert (message.pitch_x, message.pitch_y) == pytest.approx((0.001, 0.0015))
        lateral, _ = it.scene.edge.nearest(settled(it)[:, :3, 3])
        assert np.abs(lateral).max() < 3e-4
        assert it.refused == it.robot.controller.limit_violations == 0


def edge_seen_from(pose, scene):
    """Offset of an edge and its yaw, as the sensor sees it: the oracle."""
    points = (scene.edge.points - pose[:3, 3]) @ pose[:3, :3]
    (x0, y0, _), (x1, y1, _) = points[0], points[-1]
    yaw = (np.arctan2(x0 - x1, y1 - y0) + np.pi / 2) % np.pi - np.pi / 2
    return x0 * np.cos(yaw) + y0 * np.sin(yaw), yaw


def test_two_sensors_side_by_side(tmp_path):
    """Two sensors, drivers and estimators in their namespaces, each on a scene of its own."""
    wanted = {'left': (0.003, 10), 'right': (-0.004, -15)}
    with private_port() as port, bench(
            namespace='left', parameters=half_rates(tmp_path)) as left:
        listeners = {'left': left.listener,
                     'right': left.graph.add(type(left.listener), namespace='right')}
        poses, scenes, publishers = {}, {}, {}
        for name, (offset, yaw) in wanted.items():
            path = tmp_path / f'{name}.yaml'
            path.write_text(SCENE.format(name=name, offset=offset, yaw=yaw))
            scenes[name] = load_scene(path)
            poses[name] = scenes[name].start_pose()
            its_port = port.with_name(name)
            left.graph.add(MockSensorNode, namespace=name, port=str(its_port), scene=str(path))
            left.graph.add(DriverNode, namespace=name, port=str(its_port))
            left.graph.add(ContactEstimatorNode, namespace=name)
            publishers[name] = left.listener.create_publisher(
                PoseStamped, f'/{name}/sensor_pose', qos_profile_sensor_data)
        left.wait(lambda: all(it.tared for it in listeners.values()), 'both tares')

        def press():
            for name, publisher in publishers.items():
                message = PoseStamped(pose=pose_to_msg(poses[name]))
                message.header.stamp = left.listener.get_clock().now().to_msg()
                publisher.publish(message)

        left.listener.create_timer(0.005, press)
        lines = {}

        def both():
            for name, listener in listeners.items():
                lines[name] = [c for c in listener.contacts if c.valid and c.type == 2]
            return all(len(found) >= 20 for found in lines.values())

        left.wait(both, 'lines of both sensors')
        for name, found in lines.items():
            offset, yaw = edge_seen_from(poses[name], scenes[name])
            lines[name] = np.mean([c.x * np.cos(c.yaw) + c.y * np.sin(c.yaw) for c in found])
            assert lines[name] == pytest.approx(offset, abs=1e-4)
            assert np.mean([c.yaw for c in found]) == pytest.approx(yaw, abs=0.01)
        assert abs(lines['left'] - lines['right']) > 0.005
