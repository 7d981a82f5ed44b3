"""A round probe follows a ball with the whole graph, from sensor bytes to joint trajectories."""
from geometry_msgs.msg import PoseStamped
import numpy as np
import pytest
from tactile_tests.graph import bench, half_rates
import yaml

from tactile_common.ros.conversions import pose_from_msg
from tactile_common.ros.domains import hold_domain
from tactile_msgs.msg import ServoReason, ServoStatus, SurfacePatch
from tactile_msgs.srv import TeachFeatures
from tactile_shape.nodes.shape_estimator import ShapeEstimatorNode
from tactile_simulation.scene import find_scene

LENGTH, RADIUS, TOP = 0.04, 0.063, np.array([0.3, 0.0, 0.1])  # m
COARSE = {'across': 15}  # solved in some seconds, where the whole takes half a minute


@pytest.fixture(scope='module')
def tracked(tmp_path_factory):
    """Follow a ball once; the tests look at what happened."""
    folder = tmp_path_factory.mktemp('scene')
    path = folder / 'ball.yaml'
    scene = yaml.safe_load(find_scene('surfaces/sphere_126').read_text('utf-8'))
    path.write_text(yaml.safe_dump(scene | {'rubber': COARSE}))
    with bench(str(path), parameters=half_rates(folder), domain=hold_domain()) as it:
        it.scene.world()  # before the nodes begin
        it.add_all()
        it.graph.add(ShapeEstimatorNode)
        it.touches = it.listener.keep(PoseStamped, 'surface_contact', 1000)
        it.patches = it.listener.keep(SurfacePatch, 'surface_patch', 1000)
        client = it.start_tracking(length=LENGTH, speed=0.03)
        it.reach(0.5 * LENGTH)
        assert it.pause(True).success
        it.wait(lambda: it.listener.code == ServoReason.PAUSED, 'the pause')
        it.taught = [call(TeachFeatures, 'edge_servo/teach', name=name)
                     for call, name in ((it.insist, 'here'), (it.call, 'not a name'))]
        it.pause(False)
        it.finish(client)
        it.client = client
        yield it


def test_the_goal_is_met_in_spite_of_a_pause(tracked):
    client = tracked.client
    assert client.success, client.reason
    assert client.reason_code == ServoReason.LENGTH_REACHED
    held = {status.reason_code for status in tracked.listener.statuses
            if status.state == ServoStatus.HOLD}
    # If images come late just before the end, the probe brakes beyond it.
    braked = 1e-3 if held == {ServoReason.PAUSED} else 4e-3
    assert LENGTH - 1e-3 < client.result.tracked_length < LENGTH + braked
    assert client.result.contact_kept > 0.99
    states = {status.state for status in tracked.listener.statuses}
    assert {ServoStatus.APPROACH, ServoStatus.TRACK, ServoStatus.HOLD,
            ServoStatus.RETREAT} <= states
    assert tracked.refused == 0


def test_contacts_are_on_the_ball(tracked):
    # The coarse skin feels the print a tenth wider than the true one, and so its deflection.
    for poses in (tracked.touches, tracked.client.result.contacts):
        points = np.array([pose_from_msg(pose.pose)[:3, 3] for pose in poses])
        assert len(points) > 20 and np.ptp(points, axis=0).max() > 0.7 * LENGTH
        errors = tracked.scene.surface.distance(points)
        # Where the machine stalls, the probe lifts off and comes back: a few are felt in between.
        assert np.sqrt(np.mean(errors**2)) < 1.5e-4 and np.abs(errors).max() < 1e-3
        outward = np.array([pose_from_msg(pose.pose)[:3, 2] for pose in poses])
        away = (points - TOP) + [0.0, 0.0, RADIUS]  # from the middle of the ball
        assert (np.cross(outward, away / RADIUS)**2).sum(axis=1).max() < 0.03**2


def test_the_ball_is_felt_as_one_while_it_is_followed(tracked):
    known = [patch for patch in tracked.patches if patch.valid and patch.curvature_seen[0]]
    assert len(known) > 50
    curvature = np.median([patch.curvature[0] for patch in known])
    assert 1.0 / curvature == pytest.approx(RADIUS, rel=0.05)


def test_a_goal_keeps_features_that_were_shown(tracked):
    kept, refused = tracked.taught
    assert kept.success and kept.message.startswith('here: M0 ')
    assert not refused.success and 'name is' in refused.message
    client = tracked.track(length=0.01, **{'surface.features': 'here'})
    assert client.success, client.reason
    client = tracked.track(**{'surface.features': 'none'})
    assert client.finished and not client.success
    assert "no features were taught by the name 'none'; known: here" in client.reason


def test_a_cancelled_goal_comes_to_rest(tracked):
    client = tracked.start_tracking(length=LENGTH, speed=0.03)
    tracked.reach(0.2 * LENGTH)
    client.cancel()
    tracked.finish(client)
    tracked.remove('track')
    assert not client.success and client.reason_code == ServoReason.CANCELLED
    assert client.result.contacts  # what was felt until then
    tracked.wait(lambda: tracked.listener.state == ServoStatus.IDLE, 'the end')
    tracked.wait(lambda: np.abs(tracked.robot.controller.commanded[1]).max() < 1e-4,  # rad/s
                 'the rest')
