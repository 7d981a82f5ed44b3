"""A length is that of the way along the edge or surface, also if holds interrupt it."""
import numpy as np
from puma_loop import ROOT
import pytest

from tactile_servo.laws.surface_goal import SurfaceGoal
from tactile_servo.types import EdgeGoal, State
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.scene import load_scene

LENGTH = 0.1  # m
GOALS = {'straight': EdgeGoal(0.1, 5.0, length=LENGTH),
         'surfaces/plane': SurfaceGoal(0.1, 5.0, direction=(0.0, 1.0, 0.0), length=LENGTH)}


@pytest.mark.parametrize('name', GOALS)
def test_what_a_stop_takes_is_part_of_the_way(name):
    simulation = Simulation(load_scene(ROOT / f'launch/scenes/{name}.yaml'))
    status, held = simulation.run(GOALS[name], 10.0, until=lambda it: it.progress > 0.0), 0
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
