"""Offline command: the contact in every frame of a file or bag."""

import argparse
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

QUIET = 1.0  # s without a progress bar


class Tally:
    """Counts of what was found."""

    def __init__(self):
        self._types = dict.fromkeys(ContactType, 0)
        self._refusals = dict.fromkeys(Reason, 0)
        self._invalid = 0

    def add(self, records):
        """Count rows of the output."""
        refused = records['reasons'][~records['valid']]
        self._invalid += len(refused)
        for kind in self._types:
            self._types[kind] += int(np.count_nonzero(records['type'] == kind))
        for reason in self._refusals:
            if not reason & INFORMATION:
                self._refusals[reason] += int(np.count_nonzero(refused & int(reason)))

    def __str__(self):
        types, reasons = (', '.join(
            f'{count} {str(key.name).lower()}' for key, count in counts.items() if count)
            for counts in (self._types, self._refusals))
        return f'{types}; {self._invalid} not valid' + (f': {reasons}' if reasons else '')


def run(options: argparse.Namespace) -> str:
    """Estimate every frame of the input; returns the summary."""
    source = source_of(options)
    estimator = ContactEstimator(make_config(options, source.tactel))
    if Path(options.out).exists() and os.path.samefile(options.frames, options.out):
        raise ConfigurationError(f'{options.out}: is the input as well')
    total, tally, done = source.total, Tally(), 0
    with RecordWriter(options.out, source.dtype, total) as writer:
        begin = time.perf_counter()
        with Progress(total, QUIET) as progress:
            for records in source.records(estimator):
                done += len(records)
                progress.show(done, 'estimate', f'{done} of {total} frames')
                tally.add(records)
                writer.append(records)
        rate = total / max(time.perf_counter() - begin, 1e-9)
    return f'{options.out}: {total} frames, {rate:.0f} frames/s; {tally}'


def main(args: list[str] | None = None) -> int:
    """Run the command; exit status 0 if the output was written."""
    return run_command('estimate', lambda: f'estimate: {run(parse(args))}')
