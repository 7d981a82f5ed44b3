"""A length is that of the way along the edge or surface, also if holds interrupt it."""
import numpy as np
from puma_loop import coarse_scene, ROOT
import pytest

from tactile_servo.laws.surface_goal import SurfaceGoal
from tactile_servo.types import EdgeGoal, State
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.scene import load_scene

LENGTH = 0.06  # m


@pytest.mark.parametrize('scene, goal', [
    (load_scene(ROOT / 'launch/scenes/straight.yaml'), EdgeGoal(0.1, 5.0, length=LENGTH)),
    (coarse_scene('plane'), SurfaceGoal(0.1, 5.0, direction=(0.0, 1.0, 0.0), length=LENGTH))],
    ids=['edge', 'surface'])
def test_what_a_stop_takes_is_part_of_the_way(scene, goal):
    simulation = Simulation(scene)
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
