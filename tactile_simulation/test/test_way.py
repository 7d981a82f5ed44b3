"""The way along an edge or surface: holds are part of it, and one that leads nowhere ends."""
import numpy as np
from puma_loop import coarse_scene, ROOT
import pytest

from tactile_servo.laws.edge_motion import EdgeMotion
from tactile_servo.laws.surface_goal import SurfaceGoal
from tactile_servo.reasons import ReasonCode
from tactile_servo.types import EdgeGoal, State
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.scene import load_scene

LENGTH = 0.06  # m
STRAIGHT = load_scene(ROOT / 'launch/scenes/straight.yaml')
SCENES = pytest.mark.parametrize('scene, kind', [
    (STRAIGHT, EdgeGoal), (coarse_scene('plane'), SurfaceGoal)], ids=['edge', 'surface'])


@SCENES
def test_what_a_stop_takes_is_part_of_the_way(scene, kind):
    simulation = Simulation(scene)
    goal = kind(0.1, 5.0, length=LENGTH)
    status, held = simulation.run(goal, 10.0, until=lambda it: it.progress > 0.0), 0
    begin = simulation.pose[:3, 3]
    while status.state not in (State.DONE, State.IDLE) and held < 40:
        simulation.sensor_alive = False
        simulation.run(None, 0.08)
        simulation.sensor_alive = True
        status, held = simulation.run(None, 0.3), held + 1
    assert simulation.servo.success and held > 3
    simulation.run(None, 0.5)
    way = np.linalg.norm((simulation.pose[:3, 3] - begin)[:2])
    assert way == pytest.approx(LENGTH, abs=0.006)  # the last stop, and the robot's lag


def test_the_slowest_goal_is_no_stall():
    simulation = Simulation(STRAIGHT)
    simulation.run(EdgeGoal(1e-4, 5.0, length=6.5e-4), 20.0)
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
