"""Triangles of patches, and the PLY file of them that mesh viewers read."""
from collections.abc import Iterable
from os import PathLike
from pathlib import Path

import numpy as np

from tactile_shape.types.patch import Kind, Patch

# Red, green and blue of each kind of patch.
COLOURS = {Kind.NONE: (0.6, 0.6, 0.6), Kind.PLANE: (0.30, 0.55, 0.80),
           Kind.CYLINDER: (0.25, 0.65, 0.40), Kind.SPHERE: (0.90, 0.60, 0.15),
           Kind.GENERAL: (0.75, 0.30, 0.35)}
PATCH_SIZE = 6e-3  # m, side of a drawn patch
STEPS = 5  # points along each side


def mesh_of(patches: Iterable[Patch]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Return squares of the patches as triangles, coloured by kind.

    These are vertices (V, 3) [m], their red, green and blue (V, 3), and the indices (F, 3) of the
    vertices of each triangle.
    """
    vertices, colours, faces = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros((0, 3), int)]
    corner = (np.arange(STEPS - 1)[:, None] * STEPS + np.arange(STEPS - 1)).reshape(-1, 1)
    triangles = np.concatenate([corner + [0, STEPS, 1], corner + [1, STEPS, STEPS + 1]])
    side = PATCH_SIZE * np.linspace(-0.5, 0.5, STEPS)
    square = np.column_stack([np.repeat(side, STEPS), np.tile(side, STEPS)])
    for patch in patches:
        sheet = patch.sheet(square)
        finite = np.isfinite(sheet).all(axis=1)
        faces.append(triangles[finite[triangles].all(axis=1)] + sum(map(len, vertices)))
        vertices.append(np.where(finite[:, None], sheet, patch.origin))
        colours.append(np.tile(COLOURS[patch.kind], (len(sheet), 1)))
    return np.concatenate(vertices), np.concatenate(colours), np.concatenate(faces)


def save_mesh(path: str | PathLike, patches: Iterable[Patch]) -> None:
    """Write patches as a coloured mesh in the PLY format [m]."""
    vertices, colours, faces = mesh_of(patches)
    bytes_ = np.rint(255.0 * colours).astype(int)
    lines = [
        'ply', 'format ascii 1.0',
        'comment patches: blue plane, green cylinder, orange sphere, red general; m',
        f'element vertex {len(vertices)}', *(f'property double {axis}' for axis in 'xyz'),
        *(f'property uchar {colour}' for colour in ('red', 'green', 'blue')),
        f'element face {len(faces)}', 'property list uchar int vertex_indices', 'end_header',
        *(f'{x:.9g} {y:.9g} {z:.9g} {r} {g} {b}'
          for (x, y, z), (r, g, b) in zip(vertices, bytes_, strict=True)),
        *(f'3 {a} {b} {c}' for a, b, c in faces)]
    Path(path).write_text('\n'.join([*lines, '']), encoding='ascii')
