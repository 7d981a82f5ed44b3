"""
Command `build_jacobian_table`: tactile Jacobians of a round probe, for the surface servo.

The features come from a model of the probe, or from contacts that were recorded on a real one.
"""
import argparse
from dataclasses import fields
import json
import sys
import time
from typing import Any
import zipfile

import numpy as np

from tactile_common.command_line import Parser, picture_file
from tactile_common.errors import ConfigurationError, TactileError
from tactile_sensing.dome.finite_element_model import FiniteElementDome
from tactile_sensing.dome.geometry import Dome
from tactile_sensing.dome.half_space import HalfSpaceDome
from tactile_sensing.dome.operator_cache import operator_for
from tactile_sensing.dome.skin import SkinConfig
from tactile_sensing.types.array import TactelArray
from tactile_servo.tactile_jacobian.features import FeatureKind, ModelFeatures
from tactile_servo.tactile_jacobian.jacobian import Increments
from tactile_servo.tactile_jacobian.table import (
    build_table,
    grid,
    JacobianTable,
    table_of_recording,
    USABLE,
)

EXAMPLES = """\
examples:
  build_jacobian_table table.npz                       # finite elements, 6 x 6 contacts at 5 N
  build_jacobian_table table.npz --features moments --forces 1 2 4 8 --plot table.png
  build_jacobian_table table.npz --model half_space --across 12
  build_jacobian_table table.npz --recorded calibration.npz
      arrays `contacts` (N, 3): place x, y on the pad [m] and force [N], `features` (N, 3)
"""


def parser() -> argparse.ArgumentParser:
    """Command line."""
    found = Parser(
        prog='build_jacobian_table', description=(__doc__ or '').strip(), epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    add = found.add_argument
    add('out', help='table to write (.npz)')
    add('--model', default='elements', choices=('elements', 'half_space'),
        help='of the probe; the elements are solved once and kept [%(default)s]')
    add('--recorded', metavar='FILE.npz', help='contacts and features of a real probe instead')
    add('--features', default='centroid', choices=[kind.value for kind in FeatureKind],
        help='M0 and centroid, or the moments M0, Mx, My [%(default)s]')
    add('--across', type=int, default=6, help='contacts along each side of the pad [%(default)s]')
    add('--forces', type=float, nargs='+', default=[5.0], metavar='N',
        help='at each of these forces [5]')
    add('--rows', type=int, default=16, help='of tactels [%(default)s]')
    add('--columns', type=int, default=16, help='of tactels [%(default)s]')
    add('--pitch', type=float, default=0.0254 / 16, help='of the tactels [%(default)s m]')
    for kind in (Dome, SkinConfig, Increments):
        for field in fields(kind):
            unit = field.metadata['unit']
            add('--' + _option(kind, field.name), type=type(field.default),
                default=field.default,
                help=f'{field.metadata["doc"]} [{field.default:g}{" " + unit if unit else ""}]')
    add('--plot', metavar='FILE.png', type=picture_file,
        help='draw features and condition over the pad')
    add('--json', action='store_true', help='print one JSON object')
    return found


def _option(kind: type, name: str) -> str:
    """Options of the skin and of the increments say so, where they could mean another thing."""
    prefix = {Increments: 'step-', SkinConfig: 'skin-'}.get(kind, '')
    return prefix + name.replace('_', '-')


def _settings(kind: Any, options: argparse.Namespace) -> Any:
    return kind(**{field.name: getattr(options, _option(kind, field.name).replace('-', '_'))
                   for field in fields(kind)})


def make(options: argparse.Namespace) -> JacobianTable:
    """Table that the options ask for."""
    kind, increments = FeatureKind(options.features), _settings(Increments, options)
    array = TactelArray(options.rows, options.columns, options.pitch, options.pitch)
    half_x, half_y = array.half_width_x, array.half_width_y
    length = 0.5 * (half_x + half_y)
    if options.recorded:
        contacts, features = _recorded(options.recorded)
        return table_of_recording(contacts, features, kind, increments.stiffness, length)
    if options.across < 1 or min(options.forces) <= 0.0:
        raise ConfigurationError('across and forces must be above 0')
    dome = _settings(Dome, options)
    model: HalfSpaceDome | FiniteElementDome = HalfSpaceDome(dome, array)
    if options.model == 'elements':
        skin = _settings(SkinConfig, options)
        model = FiniteElementDome(dome, array, operator_for(dome, skin, array))
    return build_table(ModelFeatures(model, array, kind), kind,
                       grid(half_x, half_y, options.across, options.forces), increments, length)


def _recorded(path: str) -> tuple[np.ndarray, np.ndarray]:
    try:
        with np.load(path) as stored:
            return stored['contacts'], stored['features']
    except (OSError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise ConfigurationError(f'{path}: no contacts and features: {error}') from error


def draw(table: JacobianTable, path: str) -> None:
    """Draw where the features of the contacts lie, and the condition of their Jacobians."""
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 2, figsize=(10, 4.5), layout='constrained')
    x, y, force = table.contacts.T
    shown = table.features[:, 1:] * 1e3
    if table.kind is FeatureKind.MOMENTS:
        shown = shown / np.maximum(table.features[:, :1], 1e-9)
    axes[0].plot(1e3 * x, 1e3 * y, 'k+', label='contact')
    axes[0].scatter(*shown.T, c=force, s=12, label='centroid of its image')
    axes[0].set(xlabel='x on the pad [mm]', ylabel='y on the pad [mm]', aspect='equal')
    axes[0].legend()
    picture = axes[1].scatter(1e3 * x, 1e3 * y, c=np.log10(table.condition), s=200 / (
        1 + len(np.unique(force))), vmin=0.0, vmax=np.log10(USABLE))
    axes[1].plot(1e3 * x[~table.usable], 1e3 * y[~table.usable], 'rx', label='not used')
    axes[1].set(xlabel='x on the pad [mm]', aspect='equal')
    figure.colorbar(picture, ax=axes[1], label='log10 of the condition')
    figure.savefig(path, dpi=120)
    pyplot.close(figure)


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    begin = time.perf_counter()
    try:
        options = parser().parse_args(argv)
        table = make(options)
        table.save(options.out)
        if options.plot:
            draw(table, options.plot)
    except (TactileError, OSError) as error:
        print(f'build_jacobian_table: {error}', file=sys.stderr)
        return 2
    told = {'entries': len(table.contacts), 'usable': int(table.usable.sum()),
            'features': table.kind.value, 'condition_median': float(np.median(table.condition)),
            'condition_usable_max': float(table.condition[table.usable].max()),
            'seconds': time.perf_counter() - begin}
    if options.json:
        print(json.dumps(told))
    else:
        print(f'{told["entries"]} entries of {told["features"]}, {told["usable"]} usable; '
              f'condition {told["condition_median"]:.2f} in the median, '
              f'{told["condition_usable_max"]:.1f} at most; {told["seconds"]:.2f} s')
    return 0


if __name__ == '__main__':
    sys.exit(main())
