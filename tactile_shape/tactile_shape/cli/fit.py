"""Offline command: the surface at every contact of a recorded path."""
import argparse
import os
from pathlib import Path
import re
import sys
import time

import numpy as np

from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.npz_stream import RecordWriter
from tactile_common.progress import Progress
from tactile_shape.contact_recording import load_trace, OPTIONAL
from tactile_shape.contour.outline import find_outline
from tactile_shape.local_surface.local_quadric import LocalQuadricConfig
from tactile_shape.shape_estimator import make_estimator, METHODS, ShapeTracker
from tactile_shape.surface_matrix.surface_matrix import PARAMETERS, SurfaceMatrix
from tactile_shape.types.patch import Kind

# What of a reason differs from contact to contact.
_NUMBERS = re.compile(
    '^the path of [^ ]+ mm is |^[0-9]+ contacts see |, not all of .*|: they scatter by .*')
CHUNK = 1000  # patches written at a time
QUIET = 1.0  # s without a progress bar
PATCH = (0.02, 0.004)  # m, over which an error is taken

# Output array: its type in a row, how a patch gives it, unit and meaning.
OUTPUT = {
    't': (float, None, 's', 'time of the contact'),
    'origin': ((float, (3,)), lambda p: p.frame[:3, 3], 'm', 'contact on the fitted surface'),
    'frame': ((float, (4, 4)), lambda p: p.frame, 'm',
              'pose of the contact frame: x, y principal directions, z inward normal'),
    'kind': (np.uint8, lambda p: p.kind, '', 'least surface that explains the path; see Kinds'),
    'valid': (np.bool_, lambda p: p.valid, '', 'whether the row may be used'),
    'curvature': ((float, (2,)), lambda p: p.curvature, '1/m',
                  'principal curvatures, the larger in magnitude first, positive for convex'),
    'seen': ((np.bool_, (2,)), lambda p: p.seen, '',
             'whether the path could see each; if not, it is a prior'),
    'directions': ((float, (2, 3)), lambda p: p.frame[:3, :2].T, '',
                   'principal directions, a row each'),
    'covariance': ((float, (2, 2)), lambda p: p.covariance, '1/m^2', 'of the curvatures'),
    'surface_matrix': ((float, (4, 4)), lambda p: p.surface_matrix, 'm',
                       "S of X' S X = 0, X = [x y z 1]', in the frame of the positions"),
    'n': (np.uint32, lambda p: p.samples, '', 'contacts used'),
    'window': (float, lambda p: p.extent, 'm', 'length of the path that was used'),
    'residual': (float, lambda p: p.residual, '', 'RMS in standard deviations'),
}
RECORD = np.dtype([(name, *(kind if isinstance(kind, tuple) else (kind,)))
                   for name, (kind, *_) in OUTPUT.items()])
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


class _Parser(argparse.ArgumentParser):
    def error(self, message):
        raise ConfigurationError(message)


def _table(rows, width):
    return '\n'.join(f'  {str(name):{width}} {text}' for name, text in rows)


def parser():
    """Return the parser of the command line."""
    default = LocalQuadricConfig()
    arrays = _table(((name, f'{text}{f" [{unit}]" if unit else ""}')
                     for name, (_, _, unit, text) in OUTPUT.items()), 16)
    kinds = _table(((int(kind), text) for kind, text in KINDS.items()), 3)
    arguments = _Parser(
        prog='fit', formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False,
        usage='fit TRACE.npz|BAG -o PATCHES.npz [options]', description="""\
Fit a surface at every contact of a recorded path: plane, cylinder, sphere or general, the least
that explains the contacts. The summary goes to standard error.

Input arrays of TRACE.npz (from numpy.savez), one row per contact, SI units
  t                (N,), time, not falling
  position         (N, 3), contact in a frame in which the object is at rest; a row of NaN where
                   nothing is touched: there the path begins anew
  normal           (N, 3), the object's *inward* unit normal there: what a pad's own outward
                   normal is where it touches
and optionally, single numbers
  finger_radius    of a round finger whose normals come from where it is touched; 0 = flat
  position_noise, normal_noise, location_noise
                   standard deviations per axis: of the robot's position [m], of the normal [rad]
                   and of the contact on the pad [m]

A BAG is a rosbag2 recording (folder, .mcap or .db3) of the topics contact, sensor_pose and, for
bends and ends of edges, image.""",
        epilog=f"""\
Output arrays of PATCHES.npz, one row per contact; NaN where there is no value:
{arrays}

Kinds
{kinds}

Example
{EXAMPLE}
Exit status: 0, or 1 after one line that says what is wrong; then nothing is written.""")
    arguments.add_argument('trace', metavar='TRACE.npz|BAG', help='input')
    arguments.add_argument('-o', '--out', required=True, metavar='PATCHES.npz',
                           help='file to write; replaced if it exists')
    arguments.add_argument('--method', choices=METHODS, default=METHODS[0],
                           help="local_quadric, or the thesis' surface_matrix (default: "
                           '%(default)s)')
    arguments.add_argument('--window', type=float, default=default.window, metavar='M',
                           help='length of path that a patch is fitted to (default: %(default)s)')
    for name in OPTIONAL:
        arguments.add_argument(
            f'--{name.replace("_", "-")}', type=float, metavar='X',
            help=f'in place of the array (default of both: {getattr(default, name):g})')
    arguments.add_argument('--namespace', help='of the sensor in a bag that has several')
    arguments.add_argument('--quadric', metavar=','.join(PARAMETERS),
                           help='true surface: ten parameters of S, in the frame of the '
                           'positions; the error of each patch against it is told and drawn')
    arguments.add_argument('--outline', action='store_true',
                           help='print corners and sides of the contour')
    arguments.add_argument('--plot', metavar='FILE', help='draw samples, patches and curvatures')
    arguments.add_argument('--ply', metavar='FILE.ply', help='write the patches as a mesh; of '
                           'edges alone, the contour')
    return arguments


def parse_quadric(text):
    """Return the surface of ten numbers."""
    if text is None:
        return None
    try:
        values = [float(value) for value in text.split(',')]
    except ValueError:
        values = []
    if len(values) != len(PARAMETERS):
        raise ConfigurationError(f'--quadric: {text!r:.60} is not {len(PARAMETERS)} numbers')
    return SurfaceMatrix.from_parameters(values)


def make_config(options, trace):
    """Return the configuration that options, then the recording, then the defaults say."""
    values = {'window': options.window}
    for name in OPTIONAL:
        option, recorded = getattr(options, name), getattr(trace, name)
        value = recorded if option is None else option
        if value is not None:
            values[name] = value
    return LocalQuadricConfig(**values)


def patches(trace, tracker):
    """Yield a Patch for each contact of a trace."""
    for position, normal, edge in zip(trace.position, trace.normal, trace.edge, strict=True):
        if np.isnan(position).any():
            yield tracker.lose()
        else:
            yield tracker.touch(position, normal, edge)


def error_of(patch, quadric):
    """Largest distance of a patch of 20 x 4 mm from a true surface [m]; NaN if not valid."""
    if quadric is None or not patch.valid:
        return np.nan
    return float(np.nanmax(np.abs(quadric.distance(patch.sheet(*PATCH)))))


def run(options):
    """Fit every contact of the input; returns the summary."""
    if Path(options.out).suffix != '.npz':
        raise ConfigurationError(f'{options.out}: must end in .npz')
    quadric = parse_quadric(options.quadric)
    trace = load_trace(options.trace, options.namespace, options.finger_radius)
    if Path(options.out).exists() and os.path.samefile(options.trace, options.out):
        raise ConfigurationError(f'{options.out}: is the input as well')
    tracker = ShapeTracker(make_estimator(options.method, make_config(options, trace)))
    model = tracker.model
    begin = time.perf_counter()
    with RecordWriter(options.out, RECORD, len(trace)) as writer:
        records, errors, reasons = fit_all(trace, tracker, quadric, writer)
    rate = len(trace) / max(time.perf_counter() - begin, 1e-9)
    text = [f'{options.out}: {len(trace)} contacts, {rate:.0f} contacts/s; '
            + summary(records, reasons)]
    if np.isfinite(errors).any():
        median, most = 1e3 * np.nanpercentile(errors, [50, 95])
        text.append(f'error over {1e3 * PATCH[0]:g} x {1e3 * PATCH[1]:g} mm: median '
                    f'{median:.4f}, 95 % {most:.4f} mm')
    if options.outline:
        text.append(str(find_outline(model.contour)))
    if options.ply:
        (model.save_surface if model.patches else model.save_contour)(options.ply)
    if options.plot:
        from tactile_shape.cli.plots import draw_patches  # needs matplotlib
        draw_patches(options.plot, trace, records, model, errors)
    return '\n'.join(text)


def fit_all(trace, tracker, quadric, writer):
    """
    Fit every contact and write the rows.

    Returns
    -------
    records : ndarray of RECORD, shape (N,)
    errors : ndarray, shape (N,)
        Against the true surface [m].
    reasons : dict
        How often a patch was not valid, by reason.
    """
    records = np.zeros(len(trace), RECORD)
    errors, reasons, written = np.full(len(trace), np.nan), {}, 0
    with Progress(len(trace), QUIET) as progress:
        for k, patch in enumerate(patches(trace, tracker)):
            for name, (_, value, *_) in OUTPUT.items():
                records[name][k] = trace.t[k] if value is None else value(patch)
            errors[k] = error_of(patch, quadric)
            if not patch.valid:
                reason = _NUMBERS.sub('', patch.reason)
                reasons[reason] = reasons.get(reason, 0) + 1
            progress.show(k + 1, 'fit', f'{k + 1} of {len(trace)} contacts')
            if k + 1 - written == CHUNK or k + 1 == len(trace):
                writer.append(records[written:k + 1])
                written = k + 1
    return records, errors, reasons


def summary(records, reasons):
    """Counts of what was found, and the middle of its curvatures."""
    valid = records[records['valid']]
    parts = []
    for kind in Kind:
        some = valid[valid['kind'] == kind]
        if len(some):
            curvature = np.median(some['curvature'], axis=0)
            parts.append(f'{len(some)} {kind.name.lower()} ({curvature[0]:.4g}, '
                         f'{curvature[1]:.4g} 1/m)')
    parts.append(f'{len(records) - len(valid)} not valid'
                 + ''.join(f'; {count} {reason}' for reason, count in reasons.items()))
    return ', '.join(parts)


def main(args=None):
    """Run the command; exit status 0 if the output was written."""
    try:
        for line in run(parser().parse_args(args)).splitlines():
            print(f'fit: {line}', file=sys.stderr)
    except (TactileError, OSError) as error:
        print(f'fit: {" ".join(str(error).split())}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print('fit: interrupted, nothing written', file=sys.stderr)
        return 1
    return 0
