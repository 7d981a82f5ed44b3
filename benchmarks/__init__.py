"""Benchmarks; each uses one core, which must be set before numpy is loaded."""

import os

for _library in ('OMP', 'OPENBLAS', 'MKL'):
    os.environ.setdefault(f'{_library}_NUM_THREADS', '1')
