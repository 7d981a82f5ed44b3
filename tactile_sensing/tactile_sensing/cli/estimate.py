"""Command `estimate`: estimate the contact in every frame of a file or bag."""

import argparse
from collections.abc import Sequence
from enum import IntEnum, IntFlag
import os
from pathlib import Path
import time

import numpy as np

from tactile_common.command_line import run_command
from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import RecordWriter
from tactile_common.progress import Progress
from tactile_sensing.cli.estimate_options import make_config, parse
from tactile_sensing.cli.estimate_sources import source_of
from tactile_sensing.contact.estimator import ContactEstimator
from tactile_sensing.types.contact import ContactType, INFORMATION, Reason

QUIET = 1.0  # time before the progress bar appears [s]
REFUSALS = [reason for reason in Reason if not reason & INFORMATION]


def _counted(names: Sequence[IntEnum | IntFlag], counts: np.ndarray) -> str:
    return ', '.join(f'{count} {str(name.name).lower()}'
                     for name, count in zip(names, counts.tolist(), strict=True) if count)


def run(options: argparse.Namespace) -> str:
    """Estimate every frame of the input; return the summary."""
    source = source_of(options)
    estimator = ContactEstimator(make_config(options, source.tactel))
    if Path(options.out).exists() and os.path.samefile(options.frames, options.out):
        raise ConfigurationError(f'{options.out}: is the input as well')
    total, done, refused = source.total, 0, 0
    types, refusals = np.zeros(len(ContactType), int), np.zeros(len(REFUSALS), int)
    with RecordWriter(options.out, source.dtype, total) as writer:
        begin = time.perf_counter()
        with Progress(total, QUIET) as progress:
            for records in source.records(estimator):
                done += len(records)
                progress.show(done, 'estimate', f'{done} of {total} frames')
                writer.append(records)
                reasons = records['reasons'][~records['valid']]
                refused += len(reasons)
                types += np.bincount(records['type'], minlength=len(types))
                refusals += np.array([np.count_nonzero(reasons & int(it)) for it in REFUSALS])
        rate = total / max(time.perf_counter() - begin, 1e-9)
    why = _counted(REFUSALS, refusals)
    return (f'{options.out}: {total} frames, {rate:.0f} frames/s; '
            f'{_counted(list(ContactType), types)}; {refused} not valid' + f': {why}' * bool(why))


def main(args: list[str] | None = None) -> int:
    """Run the command; exit status 0 if the output was written."""
    return run_command('estimate', lambda: f'estimate: {run(parse(args))}')
