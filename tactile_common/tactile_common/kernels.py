"""
Where numba keeps what it compiled: a folder named after the sources of all kernels.

Numba looks at the file of the compiled function only, not at those of the functions that it
calls; a folder of its own for every state of the sources makes its cache right. Every module
with a kernel takes `njit` from here, so that the folder is set before anything is compiled.
"""

from importlib.util import find_spec
import os
from pathlib import Path
import zlib

from numba import config, njit

__all__ = ['FAST', 'njit']

PACKAGES = ('tactile_common', 'tactile_sensing', 'tactile_shape', 'tactile_servo',
            'tactile_simulation')
# Reassociation lets sums be vectorised; NaN and infinity keep their meaning.
FAST = {'reassoc', 'contract', 'nsz', 'arcp'}


def source_hash() -> str:
    """Return a name that changes with every module of these packages that has a kernel."""
    digest = 0
    for name in PACKAGES:
        spec = find_spec(name)
        for folder in spec.submodule_search_locations if spec else ():
            for path in sorted(Path(folder).rglob('*.py')):
                source = path.read_bytes()
                if b'@njit' in source:
                    digest = zlib.crc32(source, digest)
    return f'{digest:08x}'


def cache_folder() -> Path:
    """Folder of the compiled kernels: below NUMBA_CACHE_DIR, else in the user's cache."""
    root = os.environ.get('NUMBA_CACHE_DIR') or Path(
        os.environ.get('XDG_CACHE_HOME') or '~/.cache', 'tactile_kernels').expanduser()
    return Path(root, source_hash())


config.CACHE_DIR = str(cache_folder())
