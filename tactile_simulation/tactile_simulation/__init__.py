"""
Simulated world: scenes, rendered tactile images, mock sensor and robot, closed loop.

A pad on a gantry follows the installed course, with a corner and an arc:

>>> from tactile_simulation import load_scene, Simulation
>>> from tactile_servo import EdgeGoal
>>> simulation = Simulation(load_scene('launch/scenes/course.yaml'), seed=1)
>>> status = simulation.run(EdgeGoal(speed=0.05, force=5.0), 20.0)
>>> simulation.servo.success, status.reason.text
(True, 'the edge ended')
>>> lateral = simulation.truth().lateral[simulation.truth().settled]
>>> bool(abs(lateral).max() < 3e-4)  # m
True
"""
from tactile_common.exports import exported

__all__, __getattr__, __dir__ = exported(__name__, {
    'closed_loop': 'Simulation',
    'gantry': 'gantry',
    'joint_controller': 'MockController',
    'edge_world': 'EdgeScene EdgeWorld',
    'render': 'render',
    'scene': 'load_scene',
    'surface_world': 'SurfaceScene SurfaceWorld',
    'world': 'Scene World',
})
