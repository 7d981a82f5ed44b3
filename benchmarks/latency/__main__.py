"""
CPU and latency of the servo, part by part, on the real graph.

Mocks, sensing and servo run in processes of their own, as in the demo. Prints tables, and writes
benchmarks/results/latency.json and the tables into docs/latency.md.
"""

import os

from benchmarks.harness import run
from benchmarks.latency import runs

CASES = (('trace', 203.0), ('trace', 1000.0))


def measure(arguments, progress):
    """Everything that the tables show, as one dictionary."""
    rows = []
    for tracker, rate in CASES[:1] if arguments.quick else CASES:
        progress.step(f'{tracker}, {rate:g} Hz')
        rows.append(runs.account(tracker, rate))
    return {'load': os.getloadavg()[0], 'cores': os.cpu_count(), 'runs': rows}


if __name__ == '__main__':
    run('latency', __doc__, measure, lambda arguments: 1 if arguments.quick else len(CASES))
