"""A law that this package does not know needs its own file and a row of the registry."""

from circling import Circling, CirclingConfig
import numpy as np
from puma_loop import coarse_scene, summary_of
import pytest

from tactile_servo.laws.registry import LAWS, Row
from tactile_servo.laws.surface_goal import SurfaceGoal
from tactile_simulation.closed_loop import Simulation

RADIUS, FORCE = 0.008, 4.0


def test_a_law_of_ones_own_circles_a_point(monkeypatch):
    monkeypatch.setitem(LAWS, 'circling', Row(Circling, 'track_surface'))
    simulation = Simulation(coarse_scene('plane'), 'circling',
                            settings=CirclingConfig(radius=RADIUS))
    summary = summary_of(simulation, SurfaceGoal(0.02, FORCE, duration=20.0))
    assert summary['ok'] and summary['reason_code'] == 'path_completed'
    places = np.array([cycle.pose[:3, 3] for cycle in simulation.log
                       if cycle.status.state.name == 'TRACK'])
    centre = 0.5 * (places.max(axis=0) + places.min(axis=0))[:2]
    away = np.linalg.norm(places[:, :2] - centre, axis=1)
    np.testing.assert_allclose(away, RADIUS, atol=2e-4)
    assert summary['force_mean'] == pytest.approx(FORCE, rel=0.02)
    assert summary['force_max'] < 1.1 * FORCE and summary['force_end'] == 0.0
