"""Offline command that fits the surface at every contact of a recorded path."""
import argparse
from collections.abc import Iterable
import dataclasses
import os
from textwrap import indent
import time
from typing import Any

from tactile_common.command_line import file_to_write, Parser, PICTURES, run_command
from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import write_arrays
from tactile_common.progress import Progress
from tactile_shape.contact_recording import load_contacts
from tactile_shape.contour.outline import find_outline
from tactile_shape.local_surface.local_quadric import LocalQuadric, LocalQuadricConfig
from tactile_shape.mesh import save_mesh
from tactile_shape.patch_table import COLUMNS, KINDS, PatchTable
from tactile_shape.shape_estimator import ESTIMATORS, ShapeEstimator

QUIET = 1.0  # time before the progress bar appears [s]

EXAMPLE = """\
  python3 -c "
  import numpy as np
  s = np.arange(0, 0.1, 0.00025)   # 50 mm/s at 200 Hz, swinging, over a sphere of 35 mm radius
  u, v = s / 0.035, 0.002 / 0.035 * np.sin(2 * np.pi * s / 0.016)
  n = np.column_stack([-np.cos(v) * np.sin(u), -np.sin(v), np.cos(v) * np.cos(u)])
  noise = np.random.default_rng(1).normal(0, 2e-5, n.shape)
  np.savez('trace.npz', t=s / 0.05, position=[0, 0, 0.035] - 0.035 * n + noise, normal=n)
  "
  ros2 run tactile_shape fit trace.npz -o patches.npz --plot patches.png
  python3 -c "import numpy as np; print(1 / np.load('patches.npz')['curvature'][-1])"
"""


def _table(rows: Iterable[tuple[Any, str]], width: int) -> str:
    return '\n'.join(f'  {str(name):{width}} {text}' for name, text in rows)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    arrays = _table(((name, column.text + (f' [{column.unit}]' if column.unit else ''))
                     for name, column in COLUMNS.items()), 16)
    kinds = _table(((int(kind), text) for kind, text in KINDS.items()), 3)
    arguments = Parser(
        prog='fit', formatter_class=argparse.RawDescriptionHelpFormatter,
        usage='fit TRACE.npz|BAG -o PATCHES.npz [options]', description="""\
Fit a surface at every contact of a recorded path: plane, cylinder, sphere or general, the least
that explains the contacts. The summary goes to standard error.

Input arrays of TRACE.npz (from numpy.savez), one row per contact, SI units
  t                (N,), time, not falling
  position         (N, 3), contact in a frame in which the object is at rest; a row of NaN where
                   nothing is touched: there the path begins anew
  normal           (N, 3), the object's *inward* unit normal there: what a pad's own outward
                   normal is where it touches

A BAG is a rosbag2 recording (folder, .mcap or .db3) of the topics contact, sensor_pose and, for
bends and ends of edges, image.""",
        epilog=f"""\
Output arrays of PATCHES.npz, one row per contact; NaN where there is no value:
{arrays}

Kinds
{kinds}

Example
{EXAMPLE}
Exit status: 0, or 2 after one line that says what is wrong; then nothing is written.""")
    arguments.add_argument('recording', metavar='TRACE.npz|BAG', help='input')
    arguments.add_argument('-o', '--out', required=True, metavar='PATCHES.npz',
                           type=file_to_write('.npz'), help='file to write; replaced if it exists')
    arguments.add_argument('--method', choices=ESTIMATORS, default=LocalQuadric.method,
                           help="local_quadric, or the thesis' surface_matrix (default: "
                           '%(default)s)')
    for option in dataclasses.fields(LocalQuadricConfig):
        arguments.add_argument(
            f'--{option.name.replace("_", "-")}', type=float, default=option.default, metavar='X',
            help=f'{option.metadata["doc"]} [{option.metadata["unit"]}] (default: %(default)g)')
    arguments.add_argument('--namespace', help='of the sensor in a bag that has several')
    arguments.add_argument('--outline', action='store_true',
                           help='print corners and sides of the contour')
    arguments.add_argument('--contour', metavar='FILE.csv', type=file_to_write('.csv'),
                           help='write the contour: stroke, x, y, z [m]; strokes are stretches '
                           'of unbroken contact')
    arguments.add_argument('--plot', metavar='FILE', type=file_to_write(*PICTURES),
                           help='draw samples, patches and curvatures')
    arguments.add_argument('--ply', metavar='FILE.ply', type=file_to_write('.ply'),
                           help='write the patches as a mesh')
    return arguments


def run(options: argparse.Namespace) -> str:
    """Fit every contact of the input; return the summary."""
    config = LocalQuadricConfig(**{
        field.name: getattr(options, field.name)
        for field in dataclasses.fields(LocalQuadricConfig)})
    recording = load_contacts(options.recording, options.namespace, config.finger_radius)
    if options.out.exists() and os.path.samefile(options.recording, options.out):
        raise ConfigurationError(f'{options.out}: is the input as well')
    estimator = ShapeEstimator(ESTIMATORS[options.method](config))
    model, count = estimator.model, len(recording)
    table = PatchTable(recording, estimator)
    begin = time.perf_counter()
    with Progress(count, QUIET) as progress:
        for done in table.fill():
            progress.show(done, 'fit', f'{done} of {count} contacts')
    rate = count / max(time.perf_counter() - begin, 1e-9)
    write_arrays(options.out, **{name: table.records[name] for name in COLUMNS})
    text = [f'{options.out}: {count} contacts, {rate:.0f} contacts/s; {table}']
    if hint := table.hint(config.window):
        text.append(f'hint: {hint}')
    if options.outline:
        text.append(str(find_outline(model.contour)))
    if options.contour:
        model.save_points(options.contour)
    if options.ply:
        save_mesh(options.ply, model.patches)
    if options.plot:
        from tactile_shape.cli.plots import draw_patches  # needs matplotlib
        draw_patches(options.plot, recording, table, model)
    return '\n'.join(text)


def main(args: list[str] | None = None) -> int:
    """Run the command; exit status 0 if the output was written."""
    return run_command('fit', lambda: indent(run(parser().parse_args(args)), 'fit: '))
