"""What concerns all modules that numba compiles: their cache, and when they are compiled."""

from pathlib import Path
import zlib

# Reassociation lets sums be vectorised; NaN and infinity keep their meaning.
FAST = {'reassoc', 'contract', 'nsz', 'arcp'}


def fingerprint():
    """
    Return a number that changes with any module of this folder that numba compiles.

    Numba keys its cache by the file of the compiled function and by the values of its
    closure. A function that calls into other modules takes this number into its closure.
    """
    sources = (path.read_bytes() for path in sorted(Path(__file__).parent.glob('*.py')))
    return zlib.crc32(b''.join(source for source in sources if b'@njit' in source))


def warm_up():
    """Compile everything that is not in numba's cache yet, half a minute from nothing."""
    import numpy as np

    from tactile_sensing.array import TactelArray
    from tactile_sensing.estimator import ContactEstimator
    from tactile_sensing.line_fit import fit_line

    ContactEstimator()
    fit_line(np.zeros((8, 8)), TactelArray(8, 8, 1e-3, 1e-3), 1e-3, 1.0)
