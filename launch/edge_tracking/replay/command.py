"""The command `replay`."""
import argparse
from importlib.util import find_spec
import math
from pathlib import Path
import sys

from edge_tracking.replay.comparison import TOLERANCE
from edge_tracking.replay.many import bags_in, replay_many
from edge_tracking.replay.one import Options, replay_and_tell
from tactile_common.command_line import between, Parser, refusing
from tactile_common.errors import ConfigurationError
from tactile_common.progress import Progress


def parser() -> argparse.ArgumentParser:
    """Return the command-line parser."""
    arguments = Parser(
        prog='replay', formatter_class=argparse.RawDescriptionHelpFormatter,
        description='Run recordings through the cores of contact estimator, servo and shape '
        'estimator, without a graph\nand as fast as this machine can; the same bag gives the '
        'same bytes.',
        epilog='Exit status: 0 all was read, and equals what it is compared with; 1 it differs; '
        '2 it cannot be read\nwhole, or an option is wrong.')
    add = arguments.add_argument
    add('bags', nargs='+', metavar='BAG',
        help='folder, .mcap or .db3 file of a recording, or a folder of many')
    add('--from', dest='source', choices=('image', 'contact'), default='image',
        help='estimate contacts anew (default), or take the recorded ones')
    add('--set', dest='changes', action='append', default=[], metavar='NODE.PARAM=VALUE',
        help='another value of a parameter, for instance edge_servo.force.gain=0.5')
    add('-o', '--out', type=Path, metavar='OUT',
        help='new folder to write: bag, contacts.csv, cycles.csv, result.json')
    add('--parquet', action='store_true',
        help='write the tables of OUT as Parquet, too (pip install pyarrow)')
    add('--compare', nargs='?', const='', metavar='OTHER',
        help='compare with what was recorded, or with another bag')
    add('--tolerance', action='append', default=[], metavar='[[TOPIC.]FIELD=]VALUE',
        help=f'that a field may differ by (default {TOLERANCE:g})')
    add('--namespace', help='of the sensor in a bag that has several')
    add('--jobs', type=between(1, 1000, kind=int), default=1, metavar='N',
        help='of many bags, replay as many at a time; those done before in OUT are skipped')
    add('--dask', default='', metavar='ADDRESS',
        help='of many bags, replay them on a cluster that sees the same files')
    return arguments


def options_of(given: argparse.Namespace) -> Options:
    """Convert the command line to options; ConfigurationError if one is wrong."""
    tolerances = {}
    for text in given.tolerance:
        name, _, number = text.rpartition('=')
        try:
            tolerances[name] = float(number)
        except ValueError:
            tolerances[name] = math.nan
        if not tolerances[name] >= 0.0:
            raise ConfigurationError(f'--tolerance {text}: must be FIELD=VALUE, not negative')
    if given.parquet and not given.out:
        raise ConfigurationError('--parquet: needs -o, the folder of the tables')
    if given.parquet and find_spec('pyarrow') is None:
        raise ConfigurationError('--parquet: needs pyarrow: pip install pyarrow')
    return Options(given.source, tuple(given.changes), given.out, given.compare is not None,
                   given.compare or '', tolerances, given.namespace, given.parquet)


def main(args: list[str] | None = None) -> int:
    """Run the command; the exit status is explained by `--help`."""
    with refusing('replay') as command:
        args = sys.argv[1:] if args is None else args
        given = parser().parse_args(args)
        options, bags = options_of(given), bags_in(given.bags)
        if len(bags) == 1 and not given.dask:
            command.status = replay_and_tell(bags[0], options)
            return command.status
        with Progress(len(bags)) as progress:
            for done, row in enumerate(replay_many(bags, options, given.jobs, given.dask), 1):
                print(f'{row.status}  {row.bag}  {row.text}')
                progress.show(done, 'replay', f'{done} of {len(bags)} bags')
                command.status = max(command.status, row.status)
    return command.status
