"""A goal that gets nowhere ends; one that is slow because it was asked for does not."""

import pytest

from tactile_servo.laws.edge_motion import EdgeMotion
from tactile_servo.laws.surface_goal import SurfaceGoal
from tactile_servo.reasons import ReasonCode
from tactile_servo.types import EdgeGoal
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.scene import find_scene, load_scene


@pytest.mark.parametrize('scene, goal', [
    ('straight', EdgeGoal(1e-4, 5.0, length=1e-3)),
    ('surfaces/plane', SurfaceGoal(1e-4, 5.0, length=1e-3))])
def test_the_slowest_goal_is_no_stall(scene, goal):
    simulation = Simulation(load_scene(find_scene(scene)))
    simulation.run(goal, 20.0)
    assert simulation.servo.reason.code is ReasonCode.LENGTH_REACHED


def test_an_edge_along_which_the_pad_does_not_come_ends_the_goal(monkeypatch):
    simulation = Simulation(load_scene(find_scene('straight')))
    goal = EdgeGoal(0.03, 5.0)
    simulation.run(goal, 20.0, until=lambda status: status.progress > 0.01)
    monkeypatch.setattr(EdgeMotion, 'along', lambda *_, **__: (0.0, 0.0))
    simulation.run(None, 10.0)
    assert simulation.servo.reason.code is ReasonCode.NO_PROGRESS
    assert not simulation.servo.success and simulation.log[-1].force == 0.0
    assert max(cycle.force for cycle in simulation.log) < 5.5
