"""
Speed, accuracy and limits of contact estimation: chapters 2 and 3 of the thesis measured again.

Prints tables, and writes benchmarks/results/contact.json, pictures into docs/ and the tables
into docs/contact.md. Times are processor time on one core, the least of several repeats.
"""

import sys

import numpy as np

from benchmarks.contact.cases import scenes
from benchmarks.contact.measure import accuracy, limits, operations, real_skin, remedies
from benchmarks.contact.methods import peers as peer
from benchmarks.harness import finite, run

PIECES = 180  # that call `Steps.step`


def measure(arguments, progress):
    """Everything that the tables and pictures show, as one dictionary."""
    if arguments.peers:
        sys.path.append(arguments.peers)
    peers, missing = peer.load()
    rng = np.random.default_rng(arguments.seed)
    part = 0.1 if arguments.quick else 1.0
    many, few = int(2000 * part), int(200 * part)
    return finite({
        'seed': arguments.seed, 'left_out': missing,
        'versions': {name: module.__version__ for name, module in peers.items()},
        'speed_and_accuracy': accuracy.speed_and_accuracy(
            many, peers, rng, progress, 0.5 * max(part, 0.3)),
        'times': accuracy.contest(int(50 * part), peers, rng, progress),
        'fit_against_noise': accuracy.fit_against_noise(int(4000 * part), rng, progress),
        'noise_free_loads': accuracy.noise_free_loads(int(20000 * part), rng, progress),
        'table_2_4': accuracy.table_24(max(2, int(10 * part)), rng, progress),
        'table_3_3': accuracy.table_33(int(500 * part), peers, rng, progress),
        'operations': operations.counts(),
        'fault_map': limits.fault_map(many, few, rng, progress),
        'wrong_type': limits.wrong_type(int(500 * part), few, rng, progress),
        'remedies': remedies.remedies(many, rng, progress),
        'confusion': scenes.confusion(int(1000 * part), rng, progress),
        'finite_elements': real_skin.finite_elements(max(4, int(20 * part)), rng, progress),
        'ladder': real_skin.ladder(many, rng, progress)})


if __name__ == '__main__':
    run('contact', __doc__, measure, lambda _: PIECES, {
        '--seed': {'type': int, 'default': 3, 'help': 'of every random number (%(default)s)'},
        '--peers': {'metavar': 'FOLDER', 'help': (
            'where `pip install --target FOLDER` has put opencv-python-headless and '
            'scikit-image; what is missing is left out and named')}})
