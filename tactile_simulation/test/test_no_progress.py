"""A goal that gets nowhere ends; one that is slow because it was asked for does not."""

from puma_loop import coarse_scene, ROOT
import pytest

from tactile_servo.laws.edge_motion import EdgeMotion
from tactile_servo.laws.surface_goal import SurfaceGoal
from tactile_servo.reasons import ReasonCode
from tactile_servo.types import EdgeGoal
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.scene import load_scene

STRAIGHT = load_scene(ROOT / 'launch/scenes/straight.yaml')


@pytest.mark.parametrize('scene, goal', [
    (STRAIGHT, EdgeGoal(1e-4, 5.0, length=6.5e-4)),
    (coarse_scene('plane'), SurfaceGoal(1e-4, 5.0, length=6.5e-4))], ids=['edge', 'surface'])
def test_the_slowest_goal_is_no_stall(scene, goal):
    simulation = Simulation(scene)
    simulation.run(goal, 20.0)
    assert simulation.servo.reason.code is ReasonCode.LENGTH_REACHED


def test_an_edge_along_which_the_pad_does_not_come_ends_the_goal(monkeypatch):
    simulation = Simulation(STRAIGHT)
    goal = EdgeGoal(0.03, 5.0)
    simulation.run(goal, 20.0, until=lambda status: status.progress > 0.01)
    monkeypatch.setattr(EdgeMotion, 'along', lambda *_, **__: (0.0, 0.0))
    simulation.run(None, 10.0)
    assert simulation.servo.reason.code is ReasonCode.NO_PROGRESS
    assert not simulation.servo.success and simulation.log[-1].force == 0.0
    assert max(cycle.force for cycle in simulation.log) < 5.5
