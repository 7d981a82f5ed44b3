"""Cache on disk for the finite element solution of a probe's skin."""
from contextlib import suppress
from dataclasses import astuple
import hashlib
import os
from pathlib import Path
import zipfile

import numpy as np

from tactile_common.npz_stream import write_arrays
from tactile_common.progress import Progress
from tactile_sensing.dome import finite_elements
from tactile_sensing.dome.finite_elements import Operator
from tactile_sensing.dome.geometry import Dome
from tactile_sensing.dome.skin import SkinConfig
from tactile_sensing.types.array import TactelArray

QUIET = 2.0  # time before the progress bar appears [s]


def operator_for(dome: Dome, skin: SkinConfig, array: TactelArray,
                 folder: Path | None = None) -> Operator:
    """
    Return the solution for a skin from the cache; if it is missing, solve and save it.

    The file name is a hash of everything that the solution depends on, including the source code
    of the finite elements. The default folder is in the user's cache, in XDG_CACHE_HOME. If a file
    cannot be read, the skin is solved again. If the folder is not writable, nothing is saved.
    """
    folder = folder or Path(os.environ.get('XDG_CACHE_HOME') or '~/.cache').expanduser() / (
        'tactile_domes')
    path = folder / f'{_key(dome, skin, array)}.npz'
    try:
        with np.load(path) as stored:
            return Operator(**{name: stored[name] for name in Operator._fields})
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        pass
    with Progress(1.0, delay=QUIET) as bar:
        operator = finite_elements.solve(
            dome, skin, array, lambda share, step: bar.show(share, 'skin', step))
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_arrays(path, **operator._asdict())
    return operator


def _key(dome: Dome, skin: SkinConfig, array: TactelArray) -> str:
    source = Path(finite_elements.__file__).read_bytes()
    told = repr((astuple(dome), astuple(skin), astuple(array))).encode()
    return hashlib.sha256(source + told).hexdigest()[:20]
