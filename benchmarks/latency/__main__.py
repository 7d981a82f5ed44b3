"""
CPU and latency of the parts of the servo, on the real graph.

Mocks, sensing and servo run in separate processes, as in the demo. Every case runs twice: on the
machine as it is, and with its processors kept awake. Prints tables, and writes
benchmarks/results/latency.json and the tables into docs/results_latency.md.
"""

from contextlib import nullcontext
import os

from benchmarks.harness import run
from benchmarks.latency import runs
from benchmarks.latency.awake import kept_awake

CASES = (('trace', 203.0, False), ('trace', 203.0, True), ('trace', 1000.0, False),
         ('trace', 1000.0, True))
QUICK = CASES[:2]


def measure(arguments, progress):
    """Return all data of the tables as one dictionary."""
    load, rows = os.getloadavg()[0], []
    for tracker, rate, awake in QUICK if arguments.quick else CASES:
        progress.step(f'{tracker}, {rate:g} Hz{", awake" * awake}')
        with kept_awake() if awake else nullcontext():
            rows.append(runs.account(tracker, rate) | {'awake': awake})
    return {'load': load, 'cores': os.cpu_count(), 'runs': rows}


if __name__ == '__main__':
    run('latency', __doc__, measure, lambda arguments: len(QUICK if arguments.quick else CASES))
