"""Writer of polygons in the PLY format, which mesh viewers read."""
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tactile_common.errors import ConfigurationError


def write_ply(path: str | os.PathLike, vertices: ArrayLike, *, colours: ArrayLike | None = None,
              faces: Any = None, edges: Any = None, comment: str = '') -> None:
    """
    Write vertices (N, 3) with faces or edges as text; an old file is replaced atomically.

    Colours (N, 3) are red, green and blue from 0 to 1. Faces (F, 3) and edges (E, 2) are indices
    of vertices. Raises a ConfigurationError if the folder does not exist or is not writable.
    """
    vertices = np.asarray(vertices, dtype=float).reshape(-1, 3)
    header = ['ply', 'format ascii 1.0', *(f'comment {line}' for line in comment.splitlines()),
              f'element vertex {len(vertices)}', *(f'property double {c}' for c in 'xyz')]
    rows = [' '.join(f'{value:.9g}' for value in vertex) for vertex in vertices]
    if colours is not None:
        header += [f'property uchar {c}' for c in ('red', 'green', 'blue')]
        bytes_ = np.rint(255.0 * np.clip(colours, 0.0, 1.0)).astype(int)
        rows = [f'{row} {r} {g} {b}' for row, (r, g, b) in zip(rows, bytes_, strict=True)]
    if faces is not None:
        header += [f'element face {len(faces)}', 'property list uchar int vertex_indices']
        rows += [f'3 {a} {b} {c}' for a, b, c in faces]
    if edges is not None:
        header += [f'element edge {len(edges)}', 'property int vertex1', 'property int vertex2']
        rows += [f'{a} {b}' for a, b in edges]
    path = Path(path)
    part = path.with_name(f'.{path.name}.part')
    try:
        part.write_text('\n'.join([*header, 'end_header', *rows, '']), encoding='ascii')
        os.replace(part, path)
    except OSError as error:
        raise ConfigurationError(f'{path}: cannot be written: {error.strerror}') from error
