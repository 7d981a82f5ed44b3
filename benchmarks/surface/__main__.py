"""
Surface tracking with the tactile Jacobian: speed, accuracy, calibration errors; simulated.

Prints tables, and writes benchmarks/results/surface.json, pictures into docs/ and the tables into
docs/results_surface.md. Images come from the finite elements, the law uses the half-space. All
runs are seeded. They are distributed over processes; times are processor times.
"""
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
import os

import numpy as np

from benchmarks.harness import run
from benchmarks.surface import models
from benchmarks.surface.cases import cases, follow, line, OBJECTS, STABLE, worst

FIGURES = dict(zip(OBJECTS, ('6.11', '6.12', '6.14', '6.13'), strict=True))
SEEDS = 5
MODELS = ('elements', 'jacobians', 'resolution')


def measure(arguments, progress):
    """Return all data of the tables and pictures."""
    wanted = [*cases()]
    if arguments.quick:
        wanted = [case for case in wanted if case.part != 'gains']
    # Compile the kernels and solve the skin before the processes are started.
    follow(replace(wanted[0], goal=line(0.05, length=0.002)), 0)
    parts: dict[str, list] = {}
    with ProcessPoolExecutor(max_workers=arguments.processes) as pool:
        begun = [[pool.submit(follow, case, seed)
                  for seed in range(1 if arguments.quick or case.one else SEEDS)]
                 for case in wanted]
        for case, futures in zip(wanted, begun, strict=True):
            progress.step(f'{case.part}: {", ".join(map(str, case.names.values()))}')
            found = [future.result() for future in futures]
            parts.setdefault(case.part, []).append(
                {**case.names, 'seeds': len(found), **worst([numbers for numbers, *_ in found])})
            if case.figure:
                _, points, errors = found[0]
                parts.setdefault('figures', []).append(
                    {'figure': FIGURES[case.scene], 'object': case.scene, '_points': points,
                     '_errors': errors})
    parts['stability'] = limits(parts.get('gains', []))
    for name in () if arguments.quick else MODELS:
        progress.step(name)
        parts[name] = getattr(models, name)()
    return {**parts, 'cached_start': models.cached_start()}


def limits(rows):
    """Return by latency the largest gain of each control up to which all gains were stable."""
    found = []
    for latency in dict.fromkeys(row['latency'] for row in rows):
        own = [row for row in rows if row['latency'] == latency]
        stable = {}
        for control in ('predicted', 'thesis'):
            shares = [row['share'] for row in own if row['control'] == control
                      and not (row['ok'] and row['force_rms_error'] < STABLE)]
            below = min(shares, default=np.inf)
            stable[control] = max((row['share'] for row in own if row['share'] < below),
                                  default=0.0)
        found.append({'latency': latency, 'limit': own[0]['limit'], **stable})
    return found


if __name__ == '__main__':
    run('surface', __doc__, measure, lambda arguments: len([*cases()]) + len(MODELS),
        {'--processes': {'type': int, 'default': os.cpu_count() or 2,
                         'help': 'that run side by side [%(default)s]'}})
