"""
Finite element solution of a round skin that is bonded to its core, once for every tactel.

A tactel reads a linear functional b' u of the displacements u, where K u = f. With g = K^-1 b,
the reading for any load f is g' f. This needs one factorisation, and one back-substitution per
tactel. g is the displacement due to b as a load; it is evaluated where f presses (reciprocity).
"""
from collections.abc import Callable
from contextlib import suppress
from dataclasses import astuple, dataclass
import hashlib
import os
from pathlib import Path
from typing import Any, NamedTuple
import zipfile

import numpy as np
import scipy

from tactile_common.config import bounded, check_fields
from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import write_arrays
from tactile_common.progress import Progress
from tactile_sensing.dome.geometry import contact_frame, Dome
from tactile_sensing.types.array import TactelArray

GAUSS = 0.5 / np.sqrt(3.0)  # distance of sample points from a tactel's centre [tactel sides]
BESIDE = 1e-9  # relative change of a radius to get to one side of the border of two layers


@dataclass(frozen=True)
class SkinConfig:
    """Material of the skin, and the sizes of its finite element mesh."""

    young: float = bounded(0.3e6, "Young's modulus of the rubber", 'Pa', 1e3, 1e9)
    poisson: float = bounded(0.45, "Poisson's ratio of the rubber", '', 0.0, 0.499)
    half_angle: float = bounded(
        0.75, 'from the apex to the middle of the rim of the skin', 'rad', 0.1, 0.78)
    across: int = bounded(25, 'elements across the skin, each way', '', 3, 200)
    layers: int = bounded(4, 'elements from core to surface', '', 1, 20)
    points: int = bounded(4, 'points on each side of an element that loads can press', '', 1, 9)

    def __post_init__(self) -> None:
        check_fields(self, 'skin.')


class Operator(NamedTuple):
    """Readings of the tactels for unit forces on points of the skin's surface."""

    points: np.ndarray  # (N, 3): in the sensor frame [m]
    areas: np.ndarray  # (N,): surface area of each point [m^2]
    green: np.ndarray  # (N, 3, rows * columns): pressure per force [Pa/N]
    modulus: np.ndarray  # (): pressure per indentation of the skin's surface [Pa/m]


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
    given = repr((astuple(dome), astuple(skin), astuple(array))).encode()
    key = hashlib.sha256(Path(__file__).read_bytes() + given).hexdigest()[:20]
    path = folder / f'{key}.npz'
    try:
        with np.load(path) as stored:
            return Operator(**{name: stored[name] for name in Operator._fields})
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        pass
    with Progress(1.0) as bar:
        operator = solve(
            dome, skin, array, lambda share, step: bar.show(share, 'skin', step))
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_arrays(path, **operator._asdict())
    return operator


def solve(dome: Dome, skin: SkinConfig, array: TactelArray,
          progress: Callable[[float, str], None] = lambda share, step: None) -> Operator:
    """
    Solve the skin for every tactel of an array.

    `progress` is called with the share that is done and the name of the step. The elements are
    serendipity elements with 20 nodes, because elements with 8 nodes lock near incompressibility.
    The skin is free at its rim. Raises a ConfigurationError if a tactel lies beyond the rim. Needs
    scikit-fem.
    """
    import skfem
    from skfem.helpers import ddot, sym_grad, trace
    from skfem.models.elasticity import lame_parameters

    progress(0.0, 'mesh')
    # Hexahedra between core and surface: a cube's face, in equal angles, projected to spheres.
    across = np.linspace(-skin.half_angle, skin.half_angle, skin.across + 1)
    borders = across, across, np.linspace(dome.core_radius, dome.skin_radius, skin.layers + 1)
    flat = skfem.MeshHex.init_tensor(*borders)
    basis = skfem.Basis(
        skfem.MeshHex(flat.p[2] * _cube_direction(*flat.p[:2]), flat.t),
        skfem.ElementVector(skfem.ElementHexS2()), intorder=3)
    progress(0.05, 'stiffness')
    lame, mu = lame_parameters(skin.young, skin.poisson)

    @skfem.BilinearForm
    def elasticity(u: Any, v: Any, w: Any) -> Any:
        strain, virtual = sym_grad(u), sym_grad(v)
        return lame * trace(strain) * trace(virtual) + 2.0 * mu * ddot(strain, virtual)
    stiffness = elasticity.assemble(basis)
    radius = np.linalg.norm(basis.doflocs, axis=0)
    free = np.flatnonzero(radius > dome.core_radius + 1e-3 * (dome.skin_radius - dome.core_radius))
    progress(0.15, 'factorisation')
    factor = scipy.sparse.linalg.splu(stiffness[free][:, free].tocsc(), permc_spec='MMD_AT_PLUS_A',
                  options={'SymmetricMode': True}, diag_pivot_thresh=0.0)
    progress(0.5, "Green's functions")
    place = _Places(flat, borders, basis)
    points, areas, values = _surface(place, dome, skin)
    readings = _readings(place, dome, skin, array, (lame, mu))[:, free]
    values = values[:, free]
    green = np.empty((values.shape[0], readings.shape[0]))
    for k in range(readings.shape[0]):
        green[:, k] = values @ factor.solve(readings[k].toarray().ravel())
        if k % 8 == 0:
            progress(0.5 + 0.5 * k / readings.shape[0], "Green's functions")
    modulus = _modulus(values, factor, points, areas, dome)
    progress(1.0, 'done')
    return Operator(points + dome.centre, areas, green.reshape(len(points), 3, -1), modulus)


def _cube_direction(alpha: np.ndarray, beta: np.ndarray) -> np.ndarray:
    way = np.stack([np.tan(alpha), np.tan(beta), np.ones_like(alpha)])
    return way / np.linalg.norm(way, axis=0)


class _Places:
    """
    Shape functions at places of the mesh; cells are found by their borders in the flat mesh.

    The finder of scikit-fem compares every place with all cells, which takes 8 GB for 2500 cells.
    """

    def __init__(self, flat: Any, borders: tuple[np.ndarray, ...], basis: Any):
        self.basis, self._mapping, self._borders = basis, flat.mapping(), borders
        self._cells = np.empty([len(axis) - 1 for axis in borders], int)
        self._cells[self._index(flat.p[:, flat.t].mean(axis=1))] = np.arange(flat.nelements)

    def _index(self, places: np.ndarray) -> tuple[np.ndarray, ...]:
        return tuple(np.searchsorted(axis, along) - 1
                     for axis, along in zip(self._borders, places, strict=True))

    def functional(self, angles: np.ndarray, radius: float,
                   of: Callable[[np.ndarray, np.ndarray], np.ndarray]
                   ) -> 'scipy.sparse.csr_matrix':
        """
        Return M numbers at each of N places as a matrix (N * M, degrees of freedom).

        The places are angles (2, N) of the cube's face. `of` returns the numbers (N, M) of a
        shape function, given its values (3, N) and gradients (3, 3, N): of component i along j.
        """
        place = np.vstack([angles, np.full(angles.shape[1], radius)])
        cells = self._cells[self._index(place)]
        local, basis = self._mapping.invF(place[:, :, None], tind=cells), self.basis
        numbers = []
        for k in range(basis.Nbfun):
            shape = basis.elem.gbasis(basis.mapping, local, k, tind=cells)[0]
            numbers.append(of(np.asarray(shape)[..., 0], shape.grad[..., 0]))
        values = np.array(numbers)  # (functions, N, M)
        count = values[0].size
        columns = np.repeat(basis.element_dofs[:, cells], values.shape[2])
        rows = np.tile(np.arange(count), basis.Nbfun)
        return scipy.sparse.coo_matrix(
            (values.ravel(), (rows, columns)), shape=(count, basis.N)).tocsr()


def _readings(place: _Places, dome: Dome, skin: SkinConfig, array: TactelArray,
              lame: tuple[float, float]) -> 'scipy.sparse.csr_matrix':
    """
    Return the functional of each tactel, one per row.

    It is minus the mean radial stress over the tactel, averaged over both sides of its sphere.
    """
    x, y = np.meshgrid(array.x, array.y)
    outward = np.vstack([dome.direction(np.stack(
        [x + sx * GAUSS * array.pitch_x, y + sy * GAUSS * array.pitch_y], axis=-1).reshape(-1, 2))
        for sx in (-1, 1) for sy in (-1, 1)]).T
    angles = np.arctan2(outward[:2], outward[2])
    if not np.abs(angles).max() < skin.half_angle:
        raise ConfigurationError(
            f'array: a tactel lies {np.abs(angles).max():.2f} rad from the apex, beyond the rim '
            f'of the skin at {skin.half_angle:g} rad')

    def pressure(_: np.ndarray, gradient: np.ndarray) -> np.ndarray:
        pull = np.einsum('in,ijn,jn->n', outward, gradient, outward)
        return -(lame[0] * np.einsum('iin->n', gradient) + 2.0 * lame[1] * pull)[:, None]
    both = sum(place.functional(angles, side * dome.array_radius, pressure)
               for side in (1.0 - BESIDE, 1.0 + BESIDE))
    return sum(both[k * x.size:(k + 1) * x.size] for k in range(4)) / 8.0


def _surface(place: _Places, dome: Dome,
             skin: SkinConfig) -> tuple[np.ndarray, np.ndarray, 'scipy.sparse.csr_matrix']:
    """Return surface points (N, 3), their areas (N,), and their displacements (3 N, dofs)."""
    fine = skin.across * skin.points
    angle = (np.arange(fine) + 0.5) / fine * 2.0 * skin.half_angle - skin.half_angle
    angles = np.stack([grid.ravel() for grid in np.meshgrid(angle, angle, indexing='ij')])
    # Solid angle of a cell of the cube's face in equal angles.
    step = (2.0 * skin.half_angle / fine)**2
    t, s = np.tan(angles)
    areas = dome.skin_radius**2 * step * (
        (1.0 + t * t) * (1.0 + s * s) * (1.0 + t * t + s * s)**-1.5)
    values = place.functional(
        angles, (1.0 - BESIDE) * dome.skin_radius, lambda value, gradient: value.T)
    values.eliminate_zeros()
    return dome.skin_radius * _cube_direction(*angles).T, areas, values


def _modulus(values: 'scipy.sparse.csr_matrix', factor: 'scipy.sparse.linalg.SuperLU',
             points: np.ndarray, areas: np.ndarray, dome: Dome) -> np.ndarray:
    """Return pressure over indentation for a patch with the skin's thickness as radius [Pa/m]."""
    radius = dome.skin_radius - dome.core_radius
    outward = points / dome.skin_radius
    distance = np.linalg.norm(points - [0.0, 0.0, dome.skin_radius], axis=1)
    pressure = np.maximum(1.0 - (distance / radius)**2, 0.0)
    load = -(pressure * areas)[:, None] * outward
    moved = values @ factor.solve(values.T @ load.ravel())
    sunk = -(moved.reshape(-1, 3) * outward).sum(axis=1)
    weight = pressure * areas
    # Best proportionality between a parabolic pressure and its indentation.
    return np.array((weight @ pressure) / (weight @ sunk))


def superpose(green: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """Return the pressure (T,) [Pa] of loads (N, 3) [N]; green: of unit loads (N, 3, T) [Pa/N]."""
    loaded = np.flatnonzero(loads.any(axis=1))  # most loads are 0
    return np.tensordot(loads[loaded], green[loaded], 2)


@dataclass(frozen=True, eq=False)
class FiniteElementDome:
    """
    Image of a plane that is pressed against the dome.

    The state is that of `HalfSpaceDome`. The skin is treated as an elastic foundation with
    `modulus` k. The pressure of the patch is then a paraboloid of radius (4 P R / (pi k))^(1/4),
    where R is the radius of the skin. Shear has the same distribution. Raises a
    ConfigurationError if the operator has another array.
    """

    dome: Dome
    array: TactelArray
    operator: Operator

    def __post_init__(self) -> None:
        if self.operator.green.shape[2] != self.array.rows * self.array.columns:
            raise ConfigurationError(
                f'operator: has {self.operator.green.shape[2]} tactels, the array '
                f'{self.array.rows} x {self.array.columns}')

    def image(self, state: np.ndarray) -> np.ndarray:
        """Return the pressure on the tactels [Pa], (1, rows, columns); 0 without normal force."""
        if not state[2] > 0.0:
            return np.zeros((1, *self.array.shape))
        return superpose(self.operator.green, self._loads(state)).reshape(1, *self.array.shape)

    def _loads(self, state: np.ndarray) -> np.ndarray:
        """Return the forces (N, 3) on the points of the surface [N]."""
        op, radius = self.operator, self.dome.skin_radius
        axes = contact_frame(self.dome, state[0], state[1])
        patch = 4.0 * state[2] * radius / (np.pi * op.modulus)  # radius of the patch^4
        outward = (op.points - self.dome.centre) / radius
        square = 2.0 * radius**2 * (1.0 - outward @ axes[2])
        pressed = np.maximum(1.0 - square / np.sqrt(patch), 0.0) * op.areas
        total = pressed @ (outward @ axes[2])
        if not total > 0.0:
            raise ConfigurationError(
                f'state: the contact at ({state[0]:g}, {state[1]:g}) m is off the skin, '
                f'or the force of {state[2]:g} N too small for its elements')
        shear = state[3] * axes[0] + state[4] * axes[1]
        return np.outer(pressed, shear / pressed.sum()) - (state[2] / total * pressed)[
            :, None] * outward
