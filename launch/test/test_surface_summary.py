"""What summary and report say of a surface that was felt."""
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from recorded_run import with_columns

from edge_tracking.recording.run import POSES, STATUSES
from edge_tracking.recording.summary import shape_of_surface, Shown, summarise, truth
from edge_tracking.report.page import make_report
from tactile_sensing.dome.finite_elements import SkinConfig
from tactile_servo.reasons import ReasonCode
from tactile_servo.types import State
from tactile_shape.local_surface.local_quadric import LocalQuadric
from tactile_simulation.scene import load_scene

RADIUS = 0.035


def shape_of(patches):
    felt, shape = shape_of_surface(SimpleNamespace(patches=patches, touches=POSES.of([])))
    assert felt.shape == (0, 3)
    return shape


def patches(way):
    """Patches along a way of unit vectors (N, 3) over a ball."""
    surface = LocalQuadric()
    return [surface.update(RADIUS * out, -out) for out in way / np.linalg.norm(
        way, axis=1, keepdims=True)]


def test_a_winding_way_sees_all_of_a_ball_a_straight_one_not_that_it_bends_across():
    angle = np.linspace(-0.8, 0.8, 400)
    told = shape_of(patches(np.column_stack([np.sin(angle), 0.0 * angle, np.cos(angle)])))
    assert told['surface_radius'] == pytest.approx(RADIUS, rel=0.01)
    assert told['surface_kind'] == 'cylinder' and not told['surface_seen_across']
    angle = np.linspace(-0.8, 0.8, 1000)
    told = shape_of(patches(np.column_stack(
        [np.sin(angle), 0.15 * np.sin(40.0 * angle), np.cos(angle)])))
    assert told['surface_radius'] == pytest.approx(RADIUS, rel=0.01)
    assert told['surface_kind'] == 'sphere' and told['surface_seen_across']
    told = shape_of([])
    assert told['surface_kind'] == 'none' and np.isnan(told['surface_radius'])
    assert not told['surface_seen_across']


def rolled(empty, scene, outward):
    """Run whose probe was pressed 0.6 mm into a ball along each of unit vectors (N, 3)."""
    count, dome = len(outward), scene.dome
    centre = np.array(scene.surface.top) - [0.0, 0.0, RADIUS]
    stamps = 10**18 + 10_000_000 * np.arange(count)
    poses, touches = np.tile(np.eye(4), (2, count, 1, 1))
    touches[:, :3, 3] = centre + RADIUS * outward
    for pose, out in zip(poses, outward, strict=True):
        ahead = np.cross([0.0, 1.0, 0.0], -out)
        ahead /= np.linalg.norm(ahead)
        pose[:3, :3] = np.column_stack([ahead, np.cross(-out, ahead), -out])
        pose[:3, 3] = centre + (RADIUS + dome.skin_radius - 6e-4) * out - (
            pose[:3, :3] @ dome.centre)
    statuses = with_columns(
        np.zeros(count, STATUSES.dtype).view(np.recarray), stamp_ns=stamps, controller='law',
        state=State.TRACK, progress=np.linspace(0.0, 0.04, count), reason='length reached',
        force_target=5.0, reason_code=ReasonCode.LENGTH_REACHED)
    return replace(
        empty, start_ns=stamps[0], statuses=statuses, nodes=frozenset(),
        poses=POSES.of([*zip(stamps, poses, strict=True)]),
        patches=[patch for patch in patches(outward) if patch.valid],
        touches=POSES.of([*zip(stamps, touches, strict=True)]))


def test_a_run_over_a_ball_is_measured_against_it(empty, tmp_path):
    scene = replace(load_scene('surfaces/sphere_70'), rubber=SkinConfig(across=15, layers=4))
    angle = np.linspace(-0.6, 0.6, 120)
    way = np.column_stack([0.1 * np.sin(20.0 * angle), np.sin(angle), np.cos(angle)])
    run = rolled(empty, scene, way / np.linalg.norm(way, axis=1, keepdims=True))
    real = truth(run, scene)
    summary = summarise(run, scene, real)
    assert summary['ok'] and summary['contact_kept'] == 1.0 and not summary['broken']
    assert summary['surface_max'] < 1e-9 and summary['centre_max'] < 1e-8  # as it was made up
    assert np.ptp(real.force) < 1e-6 and summary['force_max'] > 1.0
    assert summary['surface_radius'] == pytest.approx(RADIUS, rel=0.01)
    fragile = replace(scene, touch=replace(scene.touch, fragile=1.0))
    broken = summarise(run, fragile, real)
    assert not broken['ok'] and broken['reason'].endswith('; but what was touched has broken')
    make_report(tmp_path / 'report.html', Shown('bag', run, summary, scene, real))
    page = (tmp_path / 'report.html').read_text('utf-8')
    assert 'Surface tracked' in page and page.count('<canvas') == 7  # way, felt 2, error 3, bends
