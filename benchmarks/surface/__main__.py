"""
Surface tracking by the tactile Jacobian: speed, accuracy, errors of calibration, in simulation.

Prints tables, and writes benchmarks/results/surface.json, pictures into docs/ and the tables into
docs/surface.md. Images come from the finite elements, the law uses the half-space. Seeded; runs
are spread over processes, since none of the figures is a time.
"""
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
import os
from typing import Any

import numpy as np

from benchmarks.harness import ROOT, run
from tactile_servo.config import ForceBounds, ServoConfig
from tactile_servo.laws.surface_config import JacobianConfig, ProbeConfig, SurfaceFollowingConfig
from tactile_servo.laws.surface_goal import Pattern, SurfaceGoal
from tactile_simulation.scene_surface import SurfaceStart
from tactile_simulation.scenes import load_any_scene
from tactile_simulation.surface_loop import summarise_surface, SurfaceSimulation
from tactile_simulation.surface_objects import Placed, StepShape

OBJECTS = ('cylinder_65', 'cylinder_120', 'sphere_70', 'sphere_126')
FIGURES = dict(zip(('6.11', '6.12', '6.14', '6.13'), OBJECTS, strict=True))
SPEEDS = (0.01, 0.05, 0.1, 0.15)
BARS = (0.05, 0.1)  # of several seeds, and of the thesis' control
STEPS = (-0.003, -0.002, -0.001, 0.001, 0.002)  # m
SOURCES = tuple((features, method) for features in ('centroid', 'moments')
                for method in ('constant', 'nearest', 'interpolated', 'online'))
PROBE = ProbeConfig()
FAULTS = {
    'none': {}, 'stiffness x 0.5': {'stiffness': 0.5 * PROBE.stiffness},
    'stiffness x 2': {'stiffness': 2.0 * PROBE.stiffness},
    'radii + 0.5 mm': {'skin_radius': 0.0275, 'array_radius': 0.0255},
    'modulus x 1.2': {'modulus': 1.2 * PROBE.modulus}}
KEYS = ('ok', 'reason_code', 'tracked_length', 'surface_rms', 'surface_max', 'centre_max',
        'force_mean', 'force_rms_error', 'force_max', 'contact_kept')
WORST = ('surface_rms', 'surface_max', 'centre_max', 'force_rms_error', 'force_max')
LONGEST = 60.0  # s simulated


@dataclass(frozen=True)
class Case:
    """A row of a table: what is followed, how, and what a row says of that."""

    part: str
    names: dict[str, Any]
    scene: str
    goal: SurfaceGoal
    settings: SurfaceFollowingConfig = field(default_factory=SurfaceFollowingConfig)
    start: SurfaceStart | None = None
    step: float | None = None  # m, of the scene `step`
    seeds: int = 1
    figure: bool = False  # whether the contacts are kept


def line(speed: float, direction=(0.4, 1.0, 0.0), length=0.06, force=5.0) -> SurfaceGoal:
    """Along a way, at an angle to everything."""
    return SurfaceGoal(speed, force, direction=direction, length=length)


def cases(seeds: int) -> Iterator[Case]:
    """Give everything that is run."""
    for name in OBJECTS:
        for speed in SPEEDS:
            yield Case('speed_and_accuracy',
                       {'object': name, 'control': 'predicted', 'speed': speed}, name,
                       line(speed), seeds=seeds if speed in BARS else 1, figure=speed == 0.05)
        for speed in BARS:
            yield Case('speed_and_accuracy',
                       {'object': name, 'control': 'thesis', 'speed': speed}, name,
                       line(speed), SurfaceFollowingConfig(control='thesis'))
    for name in ('sphere_126', 'torus'):
        yield Case('rasters', {'scene': name}, name, SurfaceGoal(
            0.05, 5.0, Pattern.RASTER, (1.0, 0.0, 0.0), size=(0.06, 0.06), step_over=0.006))
    ahead = (1.0, 0.0, 0.0)
    for step in STEPS:
        yield Case('steps', {'step': f'{1e3 * step:+g} mm', 'speed': 0.05}, 'step',
                   line(0.05, ahead, 0.04), step=step)
    yield Case('steps', {'step': 'edge to fall off', 'speed': 0.05}, 'ledge',
               line(0.05, ahead, 0.04))
    yield Case('starts', {'start': '11 mm beside the centre'}, 'sphere_70', line(0.05),
               start=SurfaceStart(aside_x=0.011))
    for force in (1.0, 15.0):
        yield Case('starts', {'start': f'{force:g} N'}, 'sphere_70', line(0.03, force=force))
    yield Case('starts', {'start': 'fragile, 5 of 6 N'}, 'fragile', line(0.05))
    yield Case('starts', {'start': 'friction of 0.3'}, 'rough', line(0.05))
    for features, method in SOURCES:
        settings = SurfaceFollowingConfig(jacobian=JacobianConfig(features, method))
        yield Case('sources', {'features': features, 'method': method}, 'sphere_70', line(0.05),
                   settings)
    for fault, change in FAULTS.items():
        settings = SurfaceFollowingConfig(probe=ProbeConfig(**change))
        yield Case('faults', {'fault': fault}, 'cylinder_65', line(0.05), settings)


def follow(case: Case, seed: int) -> tuple[dict[str, Any], list, list]:
    """Run a case once: numbers of its summary, contacts and their errors."""
    scene = load_any_scene(ROOT / f'launch/scenes/surfaces/{case.scene}.yaml')
    if case.start:
        scene = replace(scene, start=case.start)
    if case.step is not None:
        scene = replace(scene, surface=Placed(StepShape(case.step), scene.top))
    bounds = ServoConfig(force=ForceBounds(max=16.0, max_load=20.0)) if case.goal.force > 10.0 \
        else ServoConfig()
    simulation = SurfaceSimulation(scene, seed=seed, settings=case.settings, config=bounds)
    status = simulation.run(case.goal, LONGEST)
    summary = summarise_surface(simulation, case.goal, status, seed=seed)
    points = simulation.contacts - np.array(scene.top)
    return ({key: summary[key] for key in KEYS}, points.tolist(),
            scene.surface.distance(simulation.contacts).tolist())


def worst(found: list[dict[str, Any]]) -> dict[str, Any]:
    """Worst numbers of all seeds, and every way in which they ended."""
    return {**found[0], 'ok': all(one['ok'] for one in found),
            'reason_code': ', '.join(sorted({one['reason_code'] for one in found})),
            'contact_kept': min(one['contact_kept'] for one in found),
            'tracked_length': min(one['tracked_length'] for one in found),
            **{key: float(np.max([one[key] for one in found])) for key in WORST}}


def measure(arguments, progress):
    """Everything that the tables and pictures show."""
    wanted = [*cases(1 if arguments.quick else 5)]
    # Kernels are compiled, and the skin is solved, before the processes part.
    follow(replace(wanted[0], goal=line(0.05, length=0.002)), 0)
    with ProcessPoolExecutor(max_workers=max(1, (os.cpu_count() or 2) - 1)) as pool:
        begun = [[pool.submit(follow, case, seed) for seed in range(case.seeds)]
                 for case in wanted]
        parts: dict[str, list] = {}
        figures = []
        for case, futures in zip(wanted, begun, strict=True):
            progress.step(f'{case.part}: {", ".join(map(str, case.names.values()))}')
            found = [future.result() for future in futures]
            parts.setdefault(case.part, []).append(
                {**case.names, 'seeds': case.seeds, **worst([numbers for numbers, *_ in found])})
            if case.figure:
                _, points, errors = found[0]
                figures.append({'object': case.scene, '_points': points, '_errors': errors})
    for figure, name in FIGURES.items():
        next(item for item in figures if item['object'] == name)['figure'] = figure
    return {**parts, 'figures': figures}


if __name__ == '__main__':
    run('surface', __doc__, measure, lambda arguments: len([*cases(1)]))
