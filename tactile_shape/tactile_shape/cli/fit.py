"""Offline command that fits the surface at every contact of a recorded path."""
import argparse
from collections import Counter
from collections.abc import Iterable
import dataclasses
import os
import re
from textwrap import indent
import time
from typing import Any

import numpy as np

from tactile_common.command_line import file_to_write, Parser, PICTURES, run_command
from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import write_arrays
from tactile_common.progress import Progress
from tactile_shape.contact_recording import ContactRecording, load_contacts
from tactile_shape.contour.contact_path import Placed, SpatialContact
from tactile_shape.contour.outline import find_outline
from tactile_shape.local_surface.local_quadric import LocalQuadric, LocalQuadricConfig
from tactile_shape.mesh import save_mesh
from tactile_shape.shape_estimator import ESTIMATORS, ShapeEstimator
from tactile_shape.types.patch import Kind

MANY = 0.9  # share of patches with both curvatures negative that gives a hint
# Parts of a reason that differ from contact to contact.
_NUMBERS = re.compile(
    '^the path of [^ ]+ mm is |^[0-9]+ contacts see |, not all of .*|: they scatter by .*')

# Type and meaning of each array of the output.
COLUMNS = {
    't': ('f8', 'time of the contact [s]'),
    'origin': ('3f8', 'contact on the fitted surface [m]'),
    'frame': ('(4,4)f8', 'pose of the contact frame: x, y principal directions, z inward normal '
              '[m]'),
    'kind': ('u1', 'least surface that explains the path; see Kinds'),
    'valid': ('?', 'whether the row may be used'),
    'curvature': ('2f8', 'principal curvatures, the larger in magnitude first, positive for '
                  'convex [1/m]'),
    'seen': ('2?', 'whether the path could see each; if not, it is a prior'),
    'directions': ('(2,3)f8', 'principal directions, a row each'),
    'covariance': ('(2,2)f8', 'of the curvatures [1/m^2]'),
    'surface_matrix': ('(4,4)f8', "S of X' S X = 0, X = [x y z 1]', in the frame of the positions "
                       '[m]'),
    'n': ('u4', 'contacts used'),
    'window': ('f8', 'length of the path that was used [m]'),
    'residual': ('f8', 'RMS in standard deviations'),
}
_ATTRIBUTES = {'n': 'samples', 'window': 'extent'}  # of a patch, where the names differ
KINDS = {
    Kind.NONE: 'not determined: the row is not valid', Kind.PLANE: 'plane',
    Kind.CYLINDER: 'cylinder: curved in one direction', Kind.SPHERE: 'sphere',
    Kind.GENERAL: 'curved differently in the two directions'}

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
    arrays = _table(((name, text) for name, (_, text) in COLUMNS.items()), 16)
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
    begin = time.perf_counter()
    records, reasons = _fit(recording, estimator)
    rate = len(recording) / max(time.perf_counter() - begin, 1e-9)
    model = estimator.model
    outline = str(find_outline(model.contour)) if options.outline else ''
    write_arrays(options.out, **{name: records[name] for name in COLUMNS})
    text = [f'{options.out}: {len(recording)} contacts, {rate:.0f} contacts/s; '
            + _summary(records, reasons)]
    if hint := _hint(recording.position, records, config.window):
        text.append(f'hint: {hint}')
    if outline:
        text.append(outline)
    if options.contour:
        model.save_points(options.contour)
    if options.ply:
        save_mesh(options.ply, model.patches)
    if options.plot:
        from tactile_shape.cli.plots import draw_patches  # needs matplotlib
        draw_patches(options.plot, recording.position, records, model)
    return '\n'.join(text)


def _fit(recording: ContactRecording,
         estimator: ShapeEstimator) -> tuple[np.ndarray, Counter[str]]:
    """Return a record with `COLUMNS` per contact, and the number of invalid ones by reason."""
    count, reasons = len(recording), Counter[str]()
    records = np.zeros(count, [(name, kind) for name, (kind, _) in COLUMNS.items()])
    records['t'] = recording.t
    with Progress(count) as progress:
        for k, (position, normal, edge) in enumerate(zip(
                recording.position, recording.normal, recording.edge, strict=True)):
            lost = bool(np.isnan(position).any())
            contact = None if lost else SpatialContact(position, normal, edge)
            patch = estimator.take(Placed(None, contact, lost, 'nothing is touched'))
            for name in COLUMNS.keys() - {'t'}:
                records[name][k] = getattr(patch, _ATTRIBUTES.get(name, name))
            if not patch.valid:
                reasons[_NUMBERS.sub('', patch.reason)] += 1
            progress.show(k + 1, 'fit', f'{k + 1} of {count} contacts')
    return records, reasons


def _summary(records: np.ndarray, reasons: Counter[str]) -> str:
    """Return the number of patches of each kind with their median curvatures."""
    valid = records[records['valid']]
    parts = []
    for kind in Kind:
        some = valid[valid['kind'] == kind]
        if len(some):
            one, other = np.median(some['curvature'], axis=0)
            parts.append(f'{len(some)} {kind.name.lower()} ({one:.4g}, {other:.4g} 1/m)')
    parts.append(f'{len(records) - len(valid)} not valid' + ''.join(
        f'; {count} {reason}' for reason, count in reasons.items()))
    return ', '.join(parts)


def _hint(position: np.ndarray, records: np.ndarray, window: float) -> str:
    """Return a probable mistake in the units or signs of the input; empty if none shows."""
    with np.errstate(invalid='ignore', over='ignore'):  # positions may be infinite
        steps = np.linalg.norm(np.diff(position, axis=0), axis=1)
    if (step := np.nanmedian(steps) if np.isfinite(steps).any() else 0.0) > window:
        return (f'contacts are {step:.3g} m apart, more than the window of {window:g} m; are '
                'positions in metres?')
    seen = records[records['valid'] & records['seen'].all(axis=1)]
    if len(seen) and (seen['curvature'].max(axis=1) < 0.0).mean() > MANY:
        return ('the surface is concave nearly throughout; if the object is convex, the '
                'normals point out of it and must point into it')
    return ''


def main(args: list[str] | None = None) -> int:
    """Run the command; exit status 0 if the output was written."""
    return run_command('fit', lambda: indent(run(parser().parse_args(args)), 'fit: '))
