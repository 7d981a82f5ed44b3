"""Cases of the surface benchmark in the closed loop."""
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.harness import ROOT
from tactile_servo.config import ServoConfig
from tactile_servo.control.stability import gain_limit
from tactile_servo.laws.surface_config import ProbeConfig, SurfaceConfig
from tactile_servo.laws.surface_following import RATE_SHARE
from tactile_servo.laws.surface_goal import Pattern, SurfaceGoal
from tactile_simulation.closed_loop import PICTURE_RATE, Simulation
from tactile_simulation.gantry import gantry
from tactile_simulation.scene import load_scene
from tactile_simulation.surface_objects import PlacedObject, StepShape
from tactile_simulation.surface_world import SurfaceStart, SurfaceWorld

OBJECTS = ('cylinder_65', 'cylinder_120', 'sphere_70', 'sphere_126')
SPEEDS = (0.01, 0.05, 0.1, 0.15, 0.2)
LAWS = {'predicted': 'tactile_jacobian', 'thesis': 'jacobian_rate'}  # by their columns
STEPS = (-0.003, -0.002, -0.001, 0.001, 0.002)  # m
LATENCIES = (0.0, 0.005, 0.01, 0.02, 0.04)  # s
MOST_GAIN = 200.0  # 1/s, that of the printed law
GAINS = (0.25, 0.5, 0.8, 1.0, 1.4, 2.0)  # of the limit in theory
STABLE = 0.5  # N RMS of the force, above which a loop counts as unstable
FAULTS = {
    'none': {}, 'both radii + 0.5 mm': {'probe': ProbeConfig(skin_radius=0.0275)},
    **{f'modulus x {factor:g}': {'probe': ProbeConfig(modulus=factor * ProbeConfig.modulus)}
       for factor in (0.25, 1.2, 4.0)}}
OFFSETS = {'centre 1 mm off along its axis': (0.0, 0.0, 0.001),
           'centre 3 mm off sideways': (0.003, 0.0, 0.0)}
KEYS = ('ok', 'reason_code', 'tracked_length', 'surface_rms', 'surface_max', 'centre_max',
        'force_target', 'force_mean', 'force_rms_error', 'force_max', 'contact_kept')
WORST = ('surface_rms', 'surface_max', 'centre_max', 'force_rms_error', 'force_max')
LONGEST = 60.0  # s simulated
# 150 and 200 mm/s need a fast wrist and suitable limits.
FAST = SurfaceConfig(acceleration=1.0, blind=5e-5)
FAST_WRIST = 12.0  # rad/s


@dataclass(frozen=True)
class Case:
    """A row of a table: scene, goal and settings of a run, and the names in the row."""

    part: str
    names: dict[str, Any]
    scene: str
    goal: SurfaceGoal
    settings: SurfaceConfig | None = None
    law: str | None = None
    start: SurfaceStart = SurfaceStart()  # at the top, in place of the scene's start
    step: float | None = None  # m, of the scene `step`
    before: float = 0.0  # force on the probe when the goal begins [N]
    offset: tuple[float, float, float] | None = None  # true minus assumed place of the probe [m]
    latency: float | None = None  # s
    wrist: float = 0.0  # rad/s; 0: that of the gantry
    one: bool = False  # True if one seed is enough
    figure: bool = False  # True if the contacts are stored


class Misplaced(SurfaceWorld):
    """A probe displaced by an offset (3,) [m] from where the robot assumes it."""

    offset = np.eye(4)

    def _press(self, pose):
        super()._press(pose @ self.offset)


def line(speed: float, direction=(0.4, 1.0, 0.0), length=0.06, force=5.0) -> SurfaceGoal:
    """Return a goal along a line that is oblique to all axes."""
    return SurfaceGoal(speed, force, direction=direction, length=length)


def cases() -> Iterator[Case]:
    """Yield all cases."""
    for name in OBJECTS:
        for speed in SPEEDS:
            for control, law in LAWS.items():
                fast = speed > 0.1
                settings = FAST if fast else None
                yield Case(
                    'speed_and_accuracy', {'object': name, 'control': control, 'speed': speed},
                    name, line(speed, length=0.1 if fast else 0.06),
                    settings, law, wrist=FAST_WRIST if fast else 0.0,
                    one=control == 'thesis', figure=speed == 0.05 and control == 'predicted')
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
        yield Case('starts', {'start': f'from {force:g} N'}, 'sphere_70', line(0.05), before=force)
        yield Case('starts', {'start': f'at {force:g} N'}, 'sphere_70', line(0.03, force=force))
    yield Case('starts', {'start': 'fragile, 5 of 6 N'}, 'fragile', line(0.05))
    yield Case('starts', {'start': 'friction of 0.3'}, 'rough', line(0.05))
    for fault, change in FAULTS.items():
        settings = SurfaceConfig(**change)
        yield Case('faults', {'fault': fault}, 'cylinder_65', line(0.05), settings)
    for fault, offset in OFFSETS.items():
        yield Case('faults', {'fault': fault}, 'cylinder_65', line(0.05), offset=offset)
    yield from gains()


def gains() -> Iterator[Case]:
    """Yield cases with gains of the force and latencies, for both controls."""
    for latency in LATENCIES:
        # Half of each period is the mean wait for an image and for a cycle.
        plant = load_scene(scene_file('plane')).plant
        delay = latency + plant.dead_time + 0.5 / ServoConfig().rate + 0.5 / PICTURE_RATE
        limit = gain_limit(delay, plant.lag)
        for share in GAINS:
            gain = share * limit
            for control, law in LAWS.items():
                if gain > MOST_GAIN:
                    continue
                share_of_gain = RATE_SHARE if control == 'thesis' else 1.0
                settings = SurfaceConfig(force_gain=gain / share_of_gain)
                yield Case('gains', {'control': control, 'latency': latency, 'limit': limit,
                                     'share': share}, 'plane', line(0.02, length=0.02),
                           settings, law, latency=latency, one=True)


def scene_file(name):
    """Return the path of an installed scene."""
    return ROOT / f'launch/scenes/surfaces/{name}.yaml'


def follow(case: Case, seed: int) -> tuple[dict[str, Any], list, list]:
    """Run a case once; return numbers of its summary, contacts and their errors."""
    scene = replace(load_scene(scene_file(case.scene)), start=case.start)
    if case.step is not None:
        scene = replace(scene, surface=PlacedObject(StepShape(case.step), scene.surface.top))
    hardest = max(case.goal.force, case.before)
    bounds = ServoConfig(max_load=max(12.0, 1.5 * hardest))
    robot = gantry(scene.plant.acceleration, case.wrist) if case.wrist else None
    simulation = Simulation(scene, case.law, seed=seed, settings=case.settings, config=bounds,
                            latency=case.latency, robot=robot)
    if case.offset:
        simulation.world = Misplaced(scene)
        simulation.world.offset = np.eye(4)
        simulation.world.offset[:3, 3] = case.offset
    if case.before:
        press_before(simulation, case.before)
    simulation.run(case.goal, LONGEST)
    summary = simulation.summary(case.goal)
    fastest = max((cycle.status.speed for cycle in simulation.log
                   if np.isfinite(cycle.status.speed)), default=np.nan)
    felt = simulation.felt()
    points = felt - np.array(scene.surface.top)
    return ({**{key: summary[key] for key in KEYS}, 'fastest': float(fastest)}, points.tolist(),
            scene.surface.distance(felt).tolist())


def press_before(simulation: Simulation, force: float) -> None:
    """Leave the probe pressed with a force [N], as after a cancelled goal."""
    simulation.run(SurfaceGoal(0.001, force, length=0.2), 2.0)
    simulation.servo.cancel()
    simulation.run(None, 0.5)
    simulation.servo.finish()
    simulation.log.clear()


def worst(found: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the worst numbers of all seeds, and all reasons of their ends."""
    return {**found[0], 'ok': all(one['ok'] for one in found),
            'reason_code': ', '.join(sorted({one['reason_code'] for one in found})),
            'contact_kept': min(one['contact_kept'] for one in found),
            'tracked_length': min(one['tracked_length'] for one in found),
            'fastest': min(one['fastest'] for one in found),
            'force_mean': max((one['force_mean'] for one in found),
                              key=lambda mean: abs(mean - found[0]['force_target'])),
            **{key: float(np.max([one[key] for one in found])) for key in WORST}}
