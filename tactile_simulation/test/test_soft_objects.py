"""Objects that give way: stiff ones are followed, those softer than the pad end the goal."""
import numpy as np
from puma_loop import coarse_scene, summary_of
import pytest
from scipy.optimize import brentq

from tactile_servo.laws.surface_goal import Pattern, SurfaceGoal
from tactile_servo.types import EdgeGoal
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.scene import load_scene

FORCE = 5.0  # N
EDGE = EdgeGoal(0.1, FORCE)
LINE = SurfaceGoal(0.05, FORCE, Pattern.LINE, (0.0, 1.0, 0.0), 0.03)


def on_a_spring(simulation, stiffness):
    """Have the object give way along the pad's normal: stiffness in N/m."""
    render, force = simulation.world.render, simulation.world.force

    def moved(pose, way):
        pose = pose.copy()
        pose[:3, 3] -= way * pose[:3, 2]
        return pose

    def relieved(pose):
        most = force(pose) / stiffness
        return moved(pose, brentq(lambda way: force(moved(pose, way)) - stiffness * way,
                                  0.0, most, xtol=1e-7) if most > 0.0 else 0.0)
    simulation.world.render = lambda pose: render(relieved(pose))
    simulation.world.force = lambda pose: force(relieved(pose))
    return simulation


# Pressed with 5 N, the pad on an edge has 5 N/mm, the probe on a plane 16 N/mm.
@pytest.mark.parametrize('scene, goal, stiffness, followed', [
    ('straight', EDGE, 5e3, True), ('two_segments', EDGE, 1e4, True),
    ('surfaces/sphere_126', LINE, 1e4, True), ('straight', EDGE, 2e3, False),
    ('surfaces/plane', LINE, 5e3, False)])
def test_an_object_that_gives_way_is_followed_or_the_goal_ends(scene, goal, stiffness, followed):
    folder, _, name = scene.rpartition('/')
    simulation = Simulation(coarse_scene(name) if folder else load_scene(scene), seed=1)
    summary = summary_of(on_a_spring(simulation, stiffness), goal)
    assert summary['ok'] == followed, summary['reason']
    if followed:
        assert summary['force_rms_error'] < 0.3 and summary['force_max'] < 1.3 * FORCE
    else:
        assert summary['reason_code'] == 'self_test' and summary['force_max'] < FORCE
        assert summary['tracked_length'] == 0.0 and np.isclose(summary['force_end'], 0.0)
