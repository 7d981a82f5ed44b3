"""
Surface tracking by the tactile Jacobian: speed, accuracy, errors of calibration, in simulation.

Prints tables, and writes benchmarks/results/surface.json, pictures into docs/ and the tables into
docs/surface.md. Images come from the finite elements, the law uses the half-space. Seeded.
"""
import numpy as np

from benchmarks.harness import ROOT, run
from tactile_servo.laws.surface_config import JacobianConfig, ProbeConfig, SurfaceFollowingConfig
from tactile_servo.laws.surface_goal import Pattern, SurfaceGoal
from tactile_simulation.scenes import load_any_scene
from tactile_simulation.surface_loop import summarise_surface, SurfaceSimulation

OBJECTS = ('cylinder_65', 'cylinder_120', 'sphere_70', 'sphere_126')
FIGURES = dict(zip(('6.11', '6.12', '6.14', '6.13'), OBJECTS, strict=True))
SPEEDS = (0.01, 0.03, 0.05, 0.1, 0.15)
SOURCES = tuple((features, method) for features in ('centroid', 'moments')
                for method in ('constant', 'nearest', 'interpolated', 'online'))
PROBE = ProbeConfig()
FAULTS = {
    'none': {}, 'stiffness x 0.5': {'stiffness': 0.5 * PROBE.stiffness},
    'stiffness x 2': {'stiffness': 2.0 * PROBE.stiffness},
    'radii + 0.5 mm': {'skin_radius': 0.0275, 'array_radius': 0.0255},
    'modulus x 1.2': {'modulus': 1.2 * PROBE.modulus}}
KEYS = ('ok', 'reason', 'tracked_length', 'surface_rms', 'surface_max', 'centre_rms',
        'centre_max', 'force_mean', 'force_rms_error', 'force_max', 'contact_kept')
WORST = ('surface_rms', 'surface_max', 'centre_rms', 'centre_max', 'force_rms_error', 'force_max')


def follow(name, goal, seed=0, settings=None):
    """Run a goal in a shipped scene: simulation and the numbers of its summary."""
    scene = load_any_scene(ROOT / f'launch/scenes/surfaces/{name}.yaml')
    simulation = SurfaceSimulation(scene, seed=seed, settings=settings)
    status = simulation.run(goal, 60.0)
    summary = summarise_surface(simulation, goal, status, seed=seed)
    return simulation, {key: summary[key] for key in KEYS}


def line(speed):
    """Along 60 mm, at an angle to everything."""
    return SurfaceGoal(speed, 5.0, direction=(0.4, 1.0, 0.0), length=0.06)


def worst(name, goal, seeds, settings=None):
    """Worst numbers of all seeds."""
    found = [follow(name, goal, seed, settings)[1] for seed in seeds]
    return {**found[-1], 'ok': all(one['ok'] for one in found),
            **{key: float(np.max([one[key] for one in found])) for key in WORST}}


def measure(arguments, progress):
    """Everything that the tables and pictures show."""
    seeds = (0,) if arguments.quick else range(5)
    speeds, rows, figures = SPEEDS[::2] if arguments.quick else SPEEDS, [], []
    for name in OBJECTS:
        for control in ('predicted', 'thesis'):
            settings = SurfaceFollowingConfig(control=control)
            for speed in speeds:
                progress.step(f'{name}, {control}, {1e3 * speed:g} mm/s')
                own = seeds if control == 'predicted' else seeds[:1]
                rows.append({'object': name, 'control': control, 'speed': speed,
                             **worst(name, line(speed), own, settings)})
    sources = []
    for features, method in SOURCES:
        progress.step(f'{features}, {method}')
        settings = SurfaceFollowingConfig(jacobian=JacobianConfig(features, method))
        sources.append({'features': features, 'method': method,
                        **worst('sphere_70', line(0.05), seeds[:1], settings)})
    faults = []
    for fault, change in FAULTS.items():
        progress.step(fault)
        settings = SurfaceFollowingConfig(probe=ProbeConfig(**change))
        faults.append({'fault': fault, **worst('cylinder_65', line(0.05), seeds[:1], settings)})
    others = []
    for name in ('rough', 'fragile', 'step', 'ledge', 'plane'):
        progress.step(name)
        ahead = SurfaceGoal(0.03, 5.0, direction=(1.0, 0.0, 0.0), length=0.04)
        others.append({'scene': name, **worst(name, ahead, seeds[:1])})
    for name in ('sphere_126', 'torus'):
        progress.step(f'raster, {name}')
        goal = SurfaceGoal(0.05, 5.0, Pattern.RASTER, (1.0, 0.0, 0.0), size=(0.06, 0.06),
                           step_over=0.006)
        others.append({'scene': f'raster of {name}', **worst(name, goal, seeds[:1])})
    for figure, name in FIGURES.items():
        simulation, _ = follow(name, line(0.05))
        contour = simulation.servo.result().contour
        figures.append({'figure': figure, 'object': name,
                        '_points': (contour - simulation.scene.top).tolist(),
                        '_errors': simulation.scene.surface.distance(contour).tolist()})
    return {'seeds': list(seeds), 'speed_and_accuracy': rows, 'sources': sources,
            'faults': faults, 'others': others, 'figures': figures}


if __name__ == '__main__':
    run('surface', __doc__, measure, lambda arguments: 2 * len(OBJECTS) * len(
        SPEEDS[::2] if arguments.quick else SPEEDS) + len(SOURCES) + len(FAULTS) + 7)
