"""
Command `simulate`: a servo follows what a scene shows, without ROS and faster than real time.

The servo, estimator, limits and scene are those of the nodes; the robot is a gantry with the
lag, dead time and acceleration of the scene's plant, or that of a URDF.
"""
import argparse
from pathlib import Path
import sys
import time
from typing import Any

import numpy as np

from tactile_common.command_line import between, Parser
from tactile_common.errors import ConfigurationError, TactileError
from tactile_servo.config import check_goal, ServoConfig
from tactile_servo.laws.registry import law_for, LAWS
from tactile_servo.laws.surface_goal import LINE_LENGTH, Pattern, SurfaceGoal
from tactile_servo.motion.limits import JointLimits
from tactile_servo.motion.robot import RobotModel
from tactile_servo.types import EdgeGoal
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.metrics import describe, summarise, to_json
from tactile_simulation.scene_surface import SurfaceScene
from tactile_simulation.scenes import load_any_scene
from tactile_simulation.surface_loop import summarise_surface, SurfaceSimulation
from tactile_simulation.surface_plot import draw_surface

LAW_HELP = f'servo law; default: {law_for("track_edge")} for an edge, ' \
    f'{law_for("track_surface")} for a surface'
PATTERNS = (Pattern.LINE, Pattern.RASTER, Pattern.SPIRAL)
SEED = between(0, 2**32 - 1, kind=int)
JOINT_ACCELERATION = 10.0  # rad/s^2, of a robot given by its URDF


def parser() -> argparse.ArgumentParser:
    """Command line."""
    arguments = Parser(
        prog='simulate', description=__doc__.strip().splitlines()[0],
        formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    add = arguments.add_argument
    add('scene', help='YAML file of the scene')
    add('--law', '--controller', choices=list(LAWS), help=LAW_HELP)
    add('--speed', type=float, default=0.03, help='along the edge, over the surface [m/s]')
    add('--force', type=float, default=5.0, help='on the pad [N]')
    add('--direction', type=int, default=1, choices=(-1, 1), help="along the sensor's y")
    add('--length', type=between(0.0, 10.0, 'm'), default=0.0,
        help='to track [m]; 0 = until the edge ends or the contour closes; 60 mm on a surface')
    add('--pattern', default='line', choices=[pattern.name.lower() for pattern in PATTERNS],
        help='way over a surface')
    add('--heading', type=float, default=90.0, help='of that way, from base x [degrees]')
    add('--size', type=between(1e-3, 1.0, 'm'), nargs=2, default=(0.06, 0.06),
        help='of a raster or spiral [m]')
    add('--step-over', type=between(1e-4, 0.1, 'm'), default=0.006,
        help='between its rows or turns [m]')
    add('--seed', type=SEED, default=0, help="of the sensor's noise")
    add('--latency', type=between(0.0, 1.0, 's'),
        help='of a picture [s]; default as the scene says')
    add('--robot', metavar='URDF', help='robot instead of the gantry')
    add('--tip', default='tactile_pad', metavar='FRAME',
        help="sensor frame of that robot: its link's z points out of the skin")
    add('--start', type=float, nargs='+', metavar='ANGLE',
        help='joint positions near which that robot starts [rad]; default: '
             'those farthest from singularities and limits')
    add('--timeout', type=between(0.0, 1e4, 's'), default=300.0, help='simulated time [s]')
    add('--json', action='store_true', help='print one JSON object, SI units')
    add('--plot', metavar='FILE.png', help='draw the way of the pad over the edge')
    return arguments


def robot_from(urdf, tip='tactile_pad'):
    """RobotModel and JointLimits of a URDF, None for the gantry."""
    if urdf is None:
        return None
    model = RobotModel.from_urdf(urdf, tip)
    return model, JointLimits(model.joint_names, model.lower, model.upper, model.velocity_limit,
                              np.full(len(model.joint_names), JOINT_ACCELERATION))


def run(options: argparse.Namespace) -> tuple[Simulation, dict[str, Any]]:
    """Simulate as the options say: Simulation and summary."""
    scene = load_any_scene(options.scene)
    options.law = law_for(scene.action, options.law)
    check_goal(options.speed, options.force, ServoConfig())
    if isinstance(scene, SurfaceScene):
        return _run_surface(options, scene)
    goal = EdgeGoal(options.speed, options.force, options.direction, options.length,
                    closed=scene.edge.closed and options.length == 0.0
                    and LAWS[options.law].closes_contours)
    simulation = Simulation(scene, options.law, seed=options.seed,
                            latency=options.latency, robot=robot_from(options.robot, options.tip),
                            seed_positions=options.start, clock=time.perf_counter)
    begin = time.perf_counter()
    status = simulation.run(goal, options.timeout)
    return simulation, summarise(
        simulation, goal, status, name=scene.name, tracker=options.law,
        seed=options.seed, elapsed=time.perf_counter() - begin)


def _run_surface(options, scene):
    heading, pattern = np.radians(options.heading), Pattern[options.pattern.upper()]
    length = (options.length or LINE_LENGTH) if pattern is Pattern.LINE else 0.0
    goal = SurfaceGoal(
        options.speed, options.force, pattern,
        (float(np.cos(heading)), float(np.sin(heading)), 0.0), length,
        size=tuple(options.size), step_over=options.step_over)
    simulation = SurfaceSimulation(
        scene, options.law, seed=options.seed, latency=options.latency,
        robot=robot_from(options.robot, options.tip), seed_positions=options.start,
        clock=time.perf_counter)
    begin = time.perf_counter()
    status = simulation.run(goal, options.timeout)
    return simulation, summarise_surface(simulation, goal, status, seed=options.seed,
                                         elapsed=time.perf_counter() - begin)


def draw(simulation: Simulation, path) -> None:
    """Draw the way of the pad over the edge or surface, and the errors along it."""
    if isinstance(simulation, SurfaceSimulation):
        draw_surface(simulation, path)
        return
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot

    edge, truth = simulation.scene.edge, simulation.truth()
    way = np.array([cycle.pose[:3, 3] for cycle in simulation.log])
    figure, (plan, errors) = pyplot.subplots(
        2, 1, figsize=(7, 8), height_ratios=(3, 1), layout='constrained')
    outline = np.where(np.repeat(edge.solid, 2)[:, None], np.repeat(
        edge.points, 2, axis=0)[1:-1], np.nan)
    contour = simulation.servo.result().contour
    for points, look, width, label in (
            (outline, '0.7', 4, 'edge'), (way, 'C0', 1, "pad's centre"),
            (contour, 'C3', 1, 'rebuilt edge')):
        if points is not None:
            plan.plot(*1e3 * points[:, :2].T, color=look, lw=width, label=label,
                      ls=':' if points is contour else '-')
    (low, high), least = plan.get_ylim(), 0.15 * np.ptp(plan.get_xlim())  # of a straight edge
    plan.set_ylim(min(low, 0.5 * (low + high) - least), max(high, 0.5 * (low + high) + least))
    plan.set(aspect='equal', xlabel='x [mm]', ylabel='y [mm]', title=simulation.scene.name)
    plan.legend()
    errors.plot(1e3 * truth.progress[truth.tracking], 1e3 * truth.lateral[truth.tracking], 'C0')
    errors.set(xlabel='tracked length [mm]', ylabel='lateral error [mm]')
    errors.grid(alpha=0.3)
    figure.savefig(path, dpi=120)
    pyplot.close(figure)


def main(argv: list[str] | None = None) -> int:
    """Run the command; 0 only if the edge was tracked as asked for."""
    try:
        options = parser().parse_args(argv)
        if options.plot and not Path(options.plot).parent.is_dir():
            raise ConfigurationError(f'--plot {options.plot}: there is no such folder')
        simulation, summary = run(options)
        if options.plot:
            draw(simulation, options.plot)
    except (TactileError, ValueError, OSError) as error:
        print(f'simulate: {error}', file=sys.stderr)
        return 2
    print(to_json(summary) if options.json else describe(summary))
    return 0 if summary['ok'] else 1


if __name__ == '__main__':
    sys.exit(main())
