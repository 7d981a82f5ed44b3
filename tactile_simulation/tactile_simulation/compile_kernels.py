"""Calls every kernel of this package once, to compile them after a build."""
import numpy as np

from tactile_simulation.edge_path import EdgePath
from tactile_simulation.edge_world import EdgeScene, Slip, Start


def compile_kernels() -> None:
    """Press a pad on an edge that slips."""
    edge = EdgePath(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0]]))
    scene = EdgeScene('kernels', '', edge, start=Start(height=-0.001), slip=Slip(0.01, 0.001))
    scene.world().counts(scene.start_pose(), np.random.default_rng(0))
