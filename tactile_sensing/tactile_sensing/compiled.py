"""Fingerprint of the compiled modules: numba's cache notices an edit in one file only."""

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
