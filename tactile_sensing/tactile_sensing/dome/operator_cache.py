"""The solved skin of a probe, kept on disk."""
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


def operator_for(dome: Dome, skin: SkinConfig, array: TactelArray,
                 folder: Path | None = None) -> Operator:
    """
    Solved skin, from the cache if it is there; else it is built, with a bar, and kept.

    A file is named after all that it depends on, the sources of the elements included. By
    default it lies in the user's cache, below XDG_CACHE_HOME. One that cannot be read is built
    anew; where nothing can be written, nothing is kept.
    """
    folder = folder or Path(os.environ.get('XDG_CACHE_HOME') or '~/.cache').expanduser() / (
        'tactile_domes')
    path = folder / f'{_key(dome, skin, array)}.npz'
    try:
        with np.load(path) as stored:
            return Operator(**{name: stored[name] for name in Operator._fields})
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        pass
    with Progress(1.0, delay=2.0) as bar:
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
