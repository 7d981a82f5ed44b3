"""
Command `build_jacobian_table`: tactile Jacobians of a round probe, for the surface servo.

The features come from a model of the probe.
"""
import argparse
from dataclasses import fields
import sys
from typing import Any

import numpy as np

from tactile_common.command_line import Parser
from tactile_common.errors import ConfigurationError, TactileError
from tactile_sensing.dome.finite_elements import FiniteElementDome, operator_for, SkinConfig
from tactile_sensing.dome.geometry import Dome, HalfSpaceDome
from tactile_sensing.types.array import TactelArray
from tactile_servo.tactile_jacobian import (
    build_table,
    FeatureKind,
    grid,
    Increments,
    JacobianTable,
    ModelFeatures,
)

EXAMPLES = """\
examples:
  build_jacobian_table table.npz                       # finite elements, 6 x 6 contacts at 5 N
  build_jacobian_table table.npz --features moments --forces 1 2 4 8
  build_jacobian_table table.npz --model half_space --across 12
"""


def parser() -> argparse.ArgumentParser:
    """Create the parser of the command line."""
    found = Parser(
        prog='build_jacobian_table', description=(__doc__ or '').strip(), epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    add = found.add_argument
    add('out', help='table to write (.npz)')
    add('--model', default='elements', choices=('elements', 'half_space'),
        help='of the probe; the elements are solved once and kept [%(default)s]')
    add('--features', default='centroid', choices=[kind.value for kind in FeatureKind],
        help='M0 and centroid, or the moments M0, Mx, My [%(default)s]')
    add('--across', type=int, default=6, help='contacts along each side of the pad [%(default)s]')
    add('--forces', type=float, nargs='+', default=[5.0], metavar='N',
        help='at each of these forces [5]')
    add('--rows', type=int, default=16, help='of tactels [%(default)s]')
    add('--columns', type=int, default=16, help='of tactels [%(default)s]')
    add('--pitch', type=float, default=0.0254 / 16, help='of the tactels [%(default)s m]')
    for kind in (Dome, SkinConfig):
        for field in fields(kind):
            unit = field.metadata['unit']
            add('--' + _option(kind, field.name), type=type(field.default),
                default=field.default,
                help=f'{field.metadata["doc"]} [{field.default:g}{" " + unit if unit else ""}]')
    return found


def _option(kind: type, name: str) -> str:
    """Return the option of a field, with a prefix for those of the skin."""
    return ('skin-' if kind is SkinConfig else '') + name.replace('_', '-')


def _settings(kind: Any, options: argparse.Namespace) -> Any:
    return kind(**{field.name: getattr(options, _option(kind, field.name).replace('-', '_'))
                   for field in fields(kind)})


def make(options: argparse.Namespace) -> JacobianTable:
    """Build the table that the options describe."""
    kind = FeatureKind(options.features)
    array = TactelArray(options.rows, options.columns, options.pitch, options.pitch)
    half_x, half_y = array.half_width_x, array.half_width_y
    if options.across < 1 or min(options.forces) <= 0.0:
        raise ConfigurationError('across and forces must be above 0')
    dome = _settings(Dome, options)
    model: HalfSpaceDome | FiniteElementDome = HalfSpaceDome(dome, array)
    if options.model == 'elements':
        skin = _settings(SkinConfig, options)
        model = FiniteElementDome(dome, array, operator_for(dome, skin, array))
    contacts = grid(half_x, half_y, options.across, options.forces)
    return build_table(ModelFeatures(model, array, kind), kind, contacts, Increments.of(array),
                       0.5 * (half_x + half_y))


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    try:
        options = parser().parse_args(argv)
        table = make(options)
        table.save(options.out)
    except (TactileError, OSError) as error:
        print(f'build_jacobian_table: {error}', file=sys.stderr)
        return 2
    print(f'{len(table.contacts)} entries of {table.kind.value}, {table.usable.sum()} usable; '
          f'condition {np.median(table.condition):.2f} in the median, '
          f'{table.condition[table.usable].max():.1f} at most')
    return 0


if __name__ == '__main__':
    sys.exit(main())
