"""Simulated runs of the edge benchmark: scenes, sweeps, verdicts."""

from dataclasses import replace
import math
from pathlib import Path
import tempfile
import time
from unittest.mock import patch

import numpy as np
import yaml

from tactile_servo.config import ServoConfig
from tactile_servo.control import stability
from tactile_servo.control.stability import gain_limit
from tactile_servo.laws import edge_motion, resolved_rate
from tactile_servo.laws.edge_motion import EdgeFollowingConfig
from tactile_servo.laws.resolved_rate import ResolvedRateConfig
from tactile_servo.motion.motion import COMMITTED
from tactile_servo.types import EdgeGoal, State
from tactile_simulation.closed_loop import PICTURE_RATE, Simulation
from tactile_simulation.scene import load_scene

SCENES = Path(__file__).resolve().parents[2] / 'launch' / 'scenes'
FORCE = 5.0
HELD = 1.0e-3  # m; with a larger error the corner counts as cut
STABLE = 0.05e-3  # m RMS in the last part of a run
OFFSET = 0.5e-3  # m from the edge at the start of a stability test


def shipped(name):
    """Return an installed scene."""
    return load_scene(SCENES / f'{name}.yaml')


def path_scene(name, path):
    """Return the scene of a path on a plane."""
    tree = {'name': name, 'description': name,
            'edge': {'start': [0.3, -0.08, 0.15], 'heading': 90, 'path': path}}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, 'scene.yaml')
        file.write_text(yaml.safe_dump(tree), 'utf-8')
        return load_scene(file)


def follow(scene, tracker, speed, seed, *, closed=False, timed=False, seconds=120.0, **options):
    """Run once; return simulation and summary."""
    simulation = Simulation(scene, tracker, seed=seed,
                            clock=time.thread_time if timed else None, **options)
    goal = EdgeGoal(speed, FORCE, closed=closed)
    simulation.run(goal, seconds)
    return simulation, simulation.summary(goal)


def worst(summaries):
    """Return the worst errors and forces of several runs, and the number of successful runs."""
    def of(key):
        return float(np.max([summary[key] for summary in summaries]))
    mean_speed = [summary['tracked_length'] / max(tracking_time(summary), 1e-3)
                  for summary in summaries]
    return {'ok': sum(summary['ok'] for summary in summaries), 'runs': len(summaries),
            'lateral_rms': of('lateral_rms'), 'lateral_max': of('lateral_max'),
            'force_rms_error': of('force_rms_error'), 'force_max': of('force_max'),
            'joint_acceleration_max': of('joint_acceleration_max'),
            'joint_acceleration_rms': of('joint_acceleration_rms'),
            'pad_speed_scatter': of('pad_speed_scatter'),
            'mean_speed': float(np.mean(mean_speed)),
            'cpu_per_cycle': float(np.median([s['cpu_per_cycle'] for s in summaries])),
            'cpu_per_image': float(np.median([s['cpu_per_image'] for s in summaries]))}


def tracking_time(summary):
    """Return how long the pad moved along the edge [s]."""
    total, entries = 0.0, summary['states']
    for entry, after in zip(entries, entries[1:], strict=False):
        if entry['state'] in ('track', 'corner', 'search'):
            total += after['time'] - entry['time']
    return total


def corner_verdict(summary):
    """Return how a corner or curve was passed: held, cut or lost."""
    if not summary['ok'] or not math.isfinite(summary['lateral_max']):
        return 'lost'
    return 'held' if summary['lateral_max'] <= HELD else 'cut'


def theoretical_gain(latency, dead_time, lag):
    """
    Return the gain at the stability limit of a loop through the image [1/s].

    Its delay includes the latency of the image, the dead time, half of each period and the
    committed part of the servo's windows.
    """
    return gain_limit(latency + dead_time + 0.5 / ServoConfig().rate + 0.5 / PICTURE_RATE
                      + COMMITTED, lag)


def is_stable(tracker, gain, latency):
    """Return True if the pad settles on a straight edge after a small initial offset."""
    scene = shipped('straight')
    scene = replace(scene, start=replace(scene.start, offset=OFFSET))
    # Gains beyond those that a user may set, and not limited by the law.
    with patch.object(stability, 'LIMIT_SHARE', 10.0), \
            patch.object(edge_motion, 'check_fields'), patch.object(resolved_rate, 'check_fields'):
        settings = (EdgeFollowingConfig(lateral_gain=gain) if tracker == 'trace' else
                    ResolvedRateConfig(across_time=1.0 / gain))
        simulation, _ = follow(scene, tracker, 0.03, 0, latency=latency, settings=settings,
                               seconds=3.5)
    late = [cycle for cycle in simulation.log if cycle.status.state == State.TRACK][-200:]
    if len(late) < 200:
        return False
    lateral, _ = scene.edge.nearest(np.array([cycle.pose[:3, 3] for cycle in late]))
    return bool(np.sqrt(np.mean(lateral**2)) < STABLE)


def way_of(simulation):
    """Return the path of the pad and the rebuilt contour for a picture [m]."""
    way = np.array([cycle.pose[:3, 3] for cycle in simulation.log
                    if cycle.status.state not in (State.RETREAT, State.DONE)])
    contour = simulation.servo.result().contour
    return {'_way': way[::4].tolist(), '_contour': None if contour is None else contour.tolist()}
