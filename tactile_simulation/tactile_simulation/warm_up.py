"""Compile everything that the servo needs before the robot moves, not under it."""

from functools import cache

import numpy as np

from tactile_servo.motion.limits import WorkspaceBox
from tactile_servo.types import EdgeGoal
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.edge_path import EdgePath
from tactile_simulation.scene import Scene, Sensor

# m; a corner, a rise and a gap, then the end
PATH = ((0.0, 0.0, 0.0), (0.045, 0.0, 0.0), (0.06, 0.026, 0.002), (0.066, 0.036, 0.002),
        (0.08, 0.061, 0.002))
SOLID = (True, True, False, True)


@cache
def warm_up(tracker='trace'):
    """
    Track a small scene, first with little noise and then with much; once in a process.

    'trace' covers what the other tracker needs as well. A minute where numba's cache is
    empty, and two seconds where it is not.
    """
    edge = EdgePath(np.array(PATH), SOLID)
    for noise in (630.0, 6300.0):  # Pa
        scene = Scene('warm-up', '', edge, sensor=Sensor(noise_std=noise))
        simulation = Simulation(scene, tracker, workspace=WorkspaceBox([-1.0] * 3, [1.0] * 3))
        simulation.run(EdgeGoal(speed=0.1, force=5.0), seconds=2.0)
