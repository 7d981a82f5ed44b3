"""
Contact estimation: speed and accuracy compared with the thesis and libraries; golden frames.

Prints tables, and writes benchmarks/results/contact.json, a picture into docs/ and the tables
into docs/results_contact.md. Times are processor time on one core, the least of several repeats.
`golden make` and `golden score` make and judge the golden frames, whose results are in
benchmarks/results/golden.json.
"""

import sys

import numpy as np

from benchmarks.contact import accuracy, golden
from benchmarks.contact import peers as peer
from benchmarks.harness import run


def measure(arguments, progress):
    """Return all data of the tables and the picture as one dictionary."""
    if arguments.peers:
        sys.path.append(arguments.peers)
    peers, missing = peer.load()
    count = 40 if arguments.quick else 200
    return {
        'seed': arguments.seed, 'left_out': missing,
        'versions': {name: module.__version__ for name, module in peers.items()},
        'speed_and_accuracy': accuracy.speed_and_accuracy(
            count, peers, np.random.default_rng(arguments.seed), progress,
            0.05 if arguments.quick else 0.2),
        'golden': golden.families(golden.BEFORE), 'golden_now': golden.families(golden.NOW)}


if __name__ == '__main__':
    if sys.argv[1:2] == ['golden']:
        golden.main(sys.argv[2:])
    else:
        run('contact', __doc__, measure, lambda _: len(accuracy.CASES), {
            '--seed': {'type': int, 'default': 3, 'help': 'of every random number (%(default)s)'},
            '--peers': {'metavar': 'FOLDER', 'help': (
                'where `pip install --target FOLDER` has put opencv-python-headless and '
                'scikit-image; what is missing is left out and named')}})
