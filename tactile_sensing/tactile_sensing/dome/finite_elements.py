"""
Finite elements of a round skin glued to its core, solved once for every tactel.

A tactel reads a linear functional of the displacements, b' u with K u = f: with g = K^-1 b, one
factorisation and one back-substitution for each tactel, the reading of any load f is g' f. That
is the displacement which the tactel's own functional would make, read where the load presses.
"""
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import splu, SuperLU

from tactile_sensing.dome.geometry import Dome
from tactile_sensing.dome.skin import SkinConfig
from tactile_sensing.types.array import TactelArray

GAUSS = 0.5 / np.sqrt(3.0)  # of a tactel's side, from its centre to where it is sampled


class Operator(NamedTuple):
    """Readings of the tactels by unit forces on points of the skin's surface."""

    points: np.ndarray  # (N, 3), in the sensor frame [m]
    areas: np.ndarray  # (N,), of the surface that each stands for [m^2]
    green: np.ndarray  # (N, 3, rows * columns), pressure per force [Pa/N]
    modulus: np.ndarray  # (), pressure per indentation of the skin's surface [Pa/m]


def solve(dome: Dome, skin: SkinConfig, array: TactelArray,
          progress: Callable[[float, str], None] = lambda share, step: None) -> Operator:
    """
    Solve the skin for every tactel of an array; `progress` is told the share that is done.

    Serendipity elements of 20 nodes: those of 8 lock near incompressibility. The skin is free at
    its rim. Needs scikit-fem.
    """
    import skfem

    progress(0.0, 'mesh')
    mesh = _mesh(skfem, dome, skin)
    element = skfem.ElementVector(skfem.ElementHexS2())
    basis = skfem.Basis(mesh, element, intorder=3)
    progress(0.05, 'stiffness')
    lame = _lame(skin)
    stiffness = _stiffness(skfem, *lame).assemble(basis)
    radius = np.linalg.norm(basis.doflocs, axis=0)
    free = np.flatnonzero(radius > dome.core_radius + 1e-3 * (dome.skin_radius - dome.core_radius))
    progress(0.15, 'factorisation')
    factor = splu(stiffness[free][:, free].tocsc(), permc_spec='MMD_AT_PLUS_A',
                  options={'SymmetricMode': True}, diag_pivot_thresh=0.0)
    progress(0.5, "Green's functions")
    points, areas, values = _surface(basis, dome, skin)
    readings = _readings(basis, dome, skin, array, lame)[:, free]
    values = values[:, free]
    green = np.empty((values.shape[0], readings.shape[0]))
    for k in range(readings.shape[0]):
        green[:, k] = values @ factor.solve(readings[k].toarray().ravel())
        if k % 8 == 0:
            progress(0.5 + 0.5 * k / readings.shape[0], "Green's functions")
    modulus = _modulus(values, factor, points, areas, dome)
    progress(1.0, 'done')
    return Operator(points + dome.centre, areas, green.reshape(len(points), 3, -1), modulus)


def _mesh(skfem: ModuleType, dome: Dome, skin: SkinConfig) -> Any:
    """Hexahedra between core and surface: a face of a cube, in equal angles, blown up."""
    across = np.linspace(-skin.half_angle, skin.half_angle, skin.across + 1)
    mesh = skfem.MeshHex.init_tensor(
        across, across, np.linspace(dome.core_radius, dome.skin_radius, skin.layers + 1))
    alpha, beta, radius = mesh.p
    return skfem.MeshHex(radius * _cube_direction(alpha, beta), mesh.t)


def _cube_direction(alpha: np.ndarray, beta: np.ndarray) -> np.ndarray:
    way = np.stack([np.tan(alpha), np.tan(beta), np.ones_like(alpha)])
    return way / np.linalg.norm(way, axis=0)


def _lame(skin: SkinConfig) -> tuple[float, float]:
    mu = skin.young / (2.0 * (1.0 + skin.poisson))
    return 2.0 * mu * skin.poisson / (1.0 - 2.0 * skin.poisson), mu


def _stiffness(skfem: ModuleType, lame: float, mu: float) -> Any:
    from skfem.helpers import ddot, sym_grad, trace

    @skfem.BilinearForm
    def form(u: Any, v: Any, w: Any) -> Any:
        strain, virtual = sym_grad(u), sym_grad(v)
        return lame * trace(strain) * trace(virtual) + 2.0 * mu * ddot(strain, virtual)
    return form


class _Numbering(NamedTuple):
    """Where in the mesh a direction and a layer lie."""

    cells: np.ndarray  # (N,)
    places: np.ndarray  # (3, N, 1), in the unit cube


def _locate(basis: Any, skin: SkinConfig, angles: np.ndarray,
            radial: tuple[int, float]) -> _Numbering:
    """Where directions, angles (2, N) of the cube's face, meet a layer at a height of 0 to 1."""
    layer, height = radial
    step = 2.0 * skin.half_angle / skin.across
    shares = (angles + skin.half_angle) / step
    index = np.clip(np.floor(shares).astype(int), 0, skin.across - 1)
    # A cell of `init_tensor` numbers its corners so that its own axes run down, then back.
    local = 1.0 - np.vstack([np.full(shares.shape[1], height), shares - index])
    grid = _cell_grid(basis, skin)
    return _Numbering(grid[index[0], index[1], layer], local[:, :, None])


def _cell_grid(basis: Any, skin: SkinConfig) -> np.ndarray:
    """Numbers of the cells by their place across, across and up."""
    middle = basis.mesh.p[:, basis.mesh.t].mean(axis=1)
    step = 2.0 * skin.half_angle / skin.across
    i = np.floor((np.arctan2(middle[0], middle[2]) + skin.half_angle) / step).astype(int)
    j = np.floor((np.arctan2(middle[1], middle[2]) + skin.half_angle) / step).astype(int)
    grid = np.empty((skin.across, skin.across, skin.layers), dtype=int)
    order = np.lexsort((np.linalg.norm(middle, axis=0), j, i))
    grid[i[order], j[order], np.tile(np.arange(skin.layers), skin.across**2)] = order
    return grid


def _shapes(basis: Any, numbering: _Numbering
            ) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Degrees of freedom, and shape functions' values and gradients there."""
    cells, places = numbering
    for k in range(basis.Nbfun):
        shape = basis.elem.gbasis(basis.mapping, places, k, tind=cells)[0]
        yield basis.element_dofs[k, cells], np.asarray(shape)[..., 0], shape.grad[..., 0]


def _readings(basis: Any, dome: Dome, skin: SkinConfig, array: TactelArray,
              lame: tuple[float, float]) -> csr_matrix:
    """Rows of what each tactel reads: the mean radial stress over it, of both layers' sides."""
    x, y = np.meshgrid(array.x, array.y)
    rows, columns, numbers = [], [], []
    up = (dome.array_radius - dome.core_radius) / (
        dome.skin_radius - dome.core_radius) * skin.layers
    below = min(int(np.ceil(up - 1e-9)) - 1, skin.layers - 1)
    sides = [(below, up - below)]
    if abs(up - round(up)) < 1e-9 and round(up) < skin.layers:
        sides.append((round(up), 0.0))
    for dx, dy in ((sx * GAUSS, sy * GAUSS) for sx in (-1, 1) for sy in (-1, 1)):
        place = np.stack([x + dx * array.pitch_x, y + dy * array.pitch_y], axis=-1)
        outward = dome.direction(place.reshape(-1, 2)).T
        angles = np.arctan2(outward[:2], outward[2])
        for side in sides:
            numbering = _locate(basis, skin, angles, side)
            for dofs, _, gradient in _shapes(basis, numbering):
                # gradient (i, j, N): of component i along j
                pull = np.einsum('in,ijn,jn->n', outward, gradient, outward)
                stress = lame[0] * np.einsum('iin->n', gradient) + 2.0 * lame[1] * pull
                rows.append(np.arange(x.size))
                columns.append(dofs)
                numbers.append(-stress / (4.0 * len(sides)))
    return coo_matrix((np.concatenate(numbers), (np.concatenate(rows), np.concatenate(columns))),
                      shape=(x.size, basis.N)).tocsr()


def _surface(basis: Any, dome: Dome,
             skin: SkinConfig) -> tuple[np.ndarray, np.ndarray, csr_matrix]:
    """Points of the surface (N, 3), their areas, and the displacement there (3 N, dofs)."""
    fine = skin.across * skin.points
    angle = (np.arange(fine) + 0.5) / fine * 2.0 * skin.half_angle - skin.half_angle
    angles = np.stack([grid.ravel() for grid in np.meshgrid(angle, angle, indexing='ij')])
    direction = _cube_direction(*angles)
    # Solid angle of a cell of the cube's face in equal angles.
    step = (2.0 * skin.half_angle / fine)**2
    t, s = np.tan(angles)
    areas = dome.skin_radius**2 * step * (
        (1.0 + t * t) * (1.0 + s * s) * (1.0 + t * t + s * s)**-1.5)
    numbering = _locate(basis, skin, angles, (skin.layers - 1, 1.0))
    count = angles.shape[1]
    rows, columns, numbers = [], [], []
    for dofs, value, _ in _shapes(basis, numbering):
        for axis in range(3):
            rows.append(3 * np.arange(count) + axis)
            columns.append(dofs)
            numbers.append(value[axis])
    values = coo_matrix((np.concatenate(numbers), (np.concatenate(rows), np.concatenate(columns))),
                        shape=(3 * count, basis.N)).tocsr()
    values.eliminate_zeros()
    return dome.skin_radius * direction.T, areas, values


def _modulus(values: csr_matrix, factor: SuperLU, points: np.ndarray, areas: np.ndarray,
             dome: Dome) -> np.ndarray:
    """Pressure over indentation in the middle of a patch as wide as the skin is thick."""
    radius = dome.skin_radius - dome.core_radius
    outward = points / dome.skin_radius
    distance = np.linalg.norm(points - [0.0, 0.0, dome.skin_radius], axis=1)
    pressure = np.maximum(1.0 - (distance / radius)**2, 0.0)
    load = -(pressure * areas)[:, None] * outward
    moved = values @ factor.solve(values.T @ load.ravel())
    sunk = -(moved.reshape(-1, 3) * outward).sum(axis=1)
    weight = pressure * areas
    # of one whose pressure is proportional to the indentation, as far as a parabola can be
    return np.array((weight @ pressure) / (weight @ sunk))
