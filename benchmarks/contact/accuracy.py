"""Speed and accuracy of every method on the half-space, compared with the Cramer-Rao bound."""

import time

import numpy as np

from benchmarks.contact.golden_sets import half_space, PADS
from benchmarks.contact.methods import methods, names_of

DECIBELS = 40.0
CASES = ('point', 'm1'), ('point', 'm2'), ('point', 'm3'), ('line', 'm1')
WITHIN = np.radians(40.0)  # largest angle of lines from y: the closed forms need it
TRUTH = {'point': ('x', 'y', 'force', 'shear_x', 'shear_y'), 'line': ('rho', 'yaw', 'force')}
SINGLE, BATCH = 20, 500  # frames that are timed


def contacts(kind, model, count, rng):
    """Return the arrays of a set: points with shear, lines without (few methods model it)."""
    if kind == 'point':
        return half_space(rng, count, kind, PADS['26x26'], DECIBELS, model=model)
    arrays = half_space(rng, 3 * count, kind, PADS['16x16'], DECIBELS, shear=(0.0, 0.0))
    keep = np.flatnonzero(np.abs(arrays['yaw']) < WITHIN)[:count]
    return arrays | {name: np.asarray(arrays[name])[keep]
                     for name in ('frames', 'crb', *TRUTH['line'])}


def least_time(function, *, budget, repeats=5):
    """Return the processor time of one call [s]: the least of repeats within a budget [s]."""
    function()
    start = time.thread_time()
    function()
    calls = max(1, int(budget / repeats / max(time.thread_time() - start, 1e-7)))
    best = np.inf
    for _ in range(repeats):
        start = time.thread_time()
        for _ in range(calls):
            function()
        best = min(best, (time.thread_time() - start) / calls)
    return best


def times(method, frames, budget):
    """Return the time of a single call and per frame of a batch [s]; None if not available."""
    single = batched = None
    if method.one:
        some = frames[:SINGLE]
        single = least_time(lambda: [method.one(it) for it in some], budget=budget) / len(some)
    if method.many:
        some = frames[:BATCH]
        batched = least_time(lambda: method.many(some), budget=budget) / len(some)
    return {'single_s': single, 'batched_s': batched}


def accuracy(method, arrays, frames):
    """Return RMS errors, their geometric mean over the Cramer-Rao bound, and share refused."""
    kind = arrays['kind']
    truth = np.column_stack([arrays[name] for name in TRUTH[kind]])
    found, bound = method.run(frames), np.array(arrays['crb'])[:, :truth.shape[1]]
    done = np.isfinite(found[:, :2]).all(axis=1)  # the place
    given = np.isfinite(found[done]).all(axis=0)
    rms, least = (np.sqrt((part[done][:, given]**2).mean(axis=0))
                  for part in (found - truth, bound))
    names = np.array(names_of(kind))[given].tolist()
    return {'rms': dict(zip(names, rms.tolist(), strict=True)),
            'ratio': float(np.exp(np.log(rms / least).mean())),
            'refused': float(1.0 - done.mean())}


def speed_and_accuracy(count, peers, rng, progress, budget):
    """Return the rows of every method for points of models 1 to 3 and for lines."""
    rows = []
    for kind, model in CASES:
        progress.step(f'{kind}, model {model[1]}')
        arrays = contacts(kind, model, count, rng)
        frames = np.asarray(arrays['frames'], float)
        for method in methods(arrays, peers):
            rows.append({'contact': kind, 'model': int(model[1]), 'method': method.name,
                         'peer': method.peer, **times(method, frames, budget),
                         **accuracy(method, arrays, frames)})
    return rows
