"""
Command `simulate`: a servo follows a scene, without ROS and faster than real time.

Servo, estimator, limits and scene are those of the nodes. The robot is a gantry with the lag,
dead time and acceleration of the scene's plant, or the robot of a URDF.
"""
import argparse
import sys
import time

import numpy as np

from tactile_common.command_line import (
    between,
    file_to_write,
    Help,
    Parser,
    PICTURES,
    refusing,
    to_json,
)
from tactile_common.errors import ConfigurationError
from tactile_common.parameter_file import ParameterFile, parameters_of
from tactile_sensing.contact.estimator import EstimatorConfig
from tactile_servo.config import check_goal, ServoConfig
from tactile_servo.laws.registry import law_for, LAWS
from tactile_servo.laws.surface_goal import LINE_LENGTH, Pattern, SurfaceGoal
from tactile_servo.robot_config import box_of, NodeConfig, robot_of
from tactile_servo.types import EdgeGoal
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.faults import describe_faults, Fault, FORM
from tactile_simulation.metrics import describe
from tactile_simulation.scene import describe_scenes, load_scene
from tactile_simulation.world import Scene

LAW_HELP = f'servo law; default: {law_for("track_edge")} for an edge, ' \
    f'{law_for("track_surface")} for a surface'
PATTERNS = (Pattern.LINE, Pattern.RASTER, Pattern.SPIRAL)
CLIENT_TIMEOUT = 1.0  # s, default of `track`; used with faults
SEED = between(0, 2**32 - 1, kind=int)
SIZE, STEP_OVER = (0.06, 0.06), 0.006  # m, of a raster or spiral
NODE = '/tactile/edge_servo'  # node whose parameters are read from a file


def parser() -> argparse.ArgumentParser:
    """Return the command-line parser."""
    arguments = Parser(
        prog='simulate', description=__doc__.strip().splitlines()[0], formatter_class=Help,
        epilog=f'{describe_scenes()}\n\n{describe_faults()}')
    add = arguments.add_argument
    add('scene', help='name of a scene, see below, or a YAML file')
    add('--law', choices=list(LAWS), help=LAW_HELP)
    add('--speed', type=float, default=0.03, help='along the edge, over the surface [m/s]')
    add('--force', type=float, default=5.0, help='on the pad [N]')
    add('--length', type=between(0.0, 10.0, 'm'),
        help='to track [m]; default 0 = until the edge ends or the contour closes; along a line '
        'over a surface 60 mm')
    add('--direction', type=int, choices=(-1, 1),
        help="along an edge, by the sensor's y; default 1")
    add('--pattern', choices=[pattern.name.lower() for pattern in PATTERNS],
        help='way over a surface; default line')
    add('--heading', type=float,
        help='of that way, from base x [degrees]; default 90')
    add('--size', type=between(1e-3, 1.0, 'm'), nargs=2,
        help='of a raster or spiral [m]; default 0.06 0.06')
    add('--step-over', type=between(1e-4, 0.1, 'm'),
        help='between its rows or turns [m]; default 0.006')
    add('--seed', type=SEED, default=0, help="of the sensor's noise")
    add('--latency', type=between(0.0, 1.0, 's'),
        help='of an image [s]; default as the scene says')
    add('--fault', metavar=FORM, action='append', default=[],
        help='what goes wrong, see below; may be given several times')
    add('--parameters', metavar='FILE.yaml',
        help=f'parameter file: what it says of {NODE} and the contact estimator')
    add('--robot', metavar='URDF', help='robot instead of the gantry')
    add('--tip', metavar='FRAME', help="sensor frame of that robot: its link's z points out of "
        f'the skin; default {NodeConfig.tip_frame}, or as the parameter file says')
    add('--start', type=float, nargs='+', metavar='ANGLE',
        help='joint positions near which that robot starts [rad]; default: '
             'those farthest from singularities and limits')
    add('--timeout', type=between(0.0, 1e4, 's'), default=300.0, help='simulated time [s]')
    add('--json', action='store_true', help='print one JSON object, SI units')
    add('--plot', metavar='FILE.png', type=file_to_write(*PICTURES),
        help='draw the way of the pad over the edge or surface')
    return arguments


def refuse_what_does_not_apply(options: argparse.Namespace, scene: Scene) -> None:
    """Raise a ConfigurationError for an option without effect in a scene."""
    asked = f'{scene.name}: there a servo is asked for {scene.action}'
    unused = dict.fromkeys(('pattern', 'heading', 'size', 'step_over'), asked)
    if scene.action == 'track_surface':
        way = options.pattern or 'line'
        unused = {'direction': asked, **dict.fromkeys(
            ('size', 'step_over') if way == 'line' else ('length',), f'the pattern {way}')}
    if not options.robot:
        unused |= dict.fromkeys(('tip', 'start'), 'the gantry; name a --robot')
    for name, what in unused.items():
        if getattr(options, name) is not None:
            raise ConfigurationError(f'--{name.replace("_", "-")} does not apply to {what}')


def goal_of(options: argparse.Namespace, scene: Scene, law: str) -> EdgeGoal | SurfaceGoal:
    """Return the goal of the options."""
    timeout = CLIENT_TIMEOUT if options.fault else 0.0
    if scene.action == 'track_edge':
        closed = scene.closed and not options.length and LAWS[law].closes_contours
        return EdgeGoal(options.speed, options.force, options.direction or 1,
                        options.length or 0.0, closed=closed, client_timeout=timeout)
    angle = np.radians(90.0 if options.heading is None else options.heading)
    pattern = Pattern[(options.pattern or 'line').upper()]
    return SurfaceGoal(
        options.speed, options.force, pattern, (float(np.cos(angle)), float(np.sin(angle)), 0.0),
        (options.length or LINE_LENGTH) if pattern is Pattern.LINE else 0.0,
        size=tuple(options.size or SIZE), step_over=options.step_over or STEP_OVER,
        client_timeout=timeout)


def law_of(options: argparse.Namespace, scene: Scene, file: ParameterFile) -> str:
    """Return the law from options or file; ConfigurationError for parameters of no law."""
    known = {parameter.name for row in LAWS.values() for parameter in parameters_of(
        (NodeConfig, ServoConfig, row.law.config_type))}
    for section, values in file.sections:
        if section.rpartition('/')[2] == NODE.rpartition('/')[2]:
            file.refuse_unknown(section, values, known)
    return law_for(scene.action, options.law or file.values(NODE).get('law'))


def simulation_of(options: argparse.Namespace, scene: Scene, law: str,
                  file: ParameterFile) -> Simulation:
    """Return the closed loop of a scene with robot, limits, box and settings from the options."""
    own, config = scene.parameters(), file.config(NODE, ServoConfig)
    check_goal(options.speed, options.force, config)
    settings = file.config(NODE, LAWS[law].law.config_type, own.get('edge_servo'))
    node = file.config(NODE, NodeConfig, {'robot_description': options.robot or '', **(
        {'tip_frame': options.tip} if options.tip else {})})
    box = box_of(node)
    outside = box.beyond(scene.start_pose()[:3, 3])
    if outside.any():
        raise ConfigurationError(f'the start of {scene.name} lies {outside.max():.6g} m outside '
                                 'of workspace.lower and workspace.upper')
    return Simulation(
        scene, law, seed=options.seed, latency=options.latency, config=config,
        settings=settings, robot=robot_of(node)[:2] if options.robot else None,
        seed_positions=options.start, workspace=box, clock=time.perf_counter, faults=[
            Fault.of(text) for text in options.fault], estimator=file.config(
            '/tactile/contact_estimator', EstimatorConfig, own.get('contact_estimator')))


def main(argv: list[str] | None = None) -> int:
    """Run the command; exit status 0 only if the goal was met."""
    with refusing('simulate') as command:
        options = parser().parse_args(argv)
        scene = load_scene(options.scene)
        refuse_what_does_not_apply(options, scene)
        file = ParameterFile(options.parameters)
        law = law_of(options, scene, file)
        goal, simulation = goal_of(options, scene, law), simulation_of(options, scene, law, file)
        begin = time.perf_counter()
        simulation.run(goal, options.timeout)
        summary = simulation.summary(goal, time.perf_counter() - begin)
        if options.plot:
            from tactile_simulation.plot import draw  # matplotlib takes a second to import
            draw(simulation, options.plot)
        print(to_json(summary) if options.json else describe(summary))
        command.status = 0 if summary['ok'] else 1
    return command.status


if __name__ == '__main__':
    sys.exit(main())
