"""
Additional pressure profiles for the golden images, not contained in `fe_frames`.

They have more depths of the bone, a cylinder of 5 mm at 1 N/mm, narrow punches, and the response
to a load on a disc or strip of .15 mm, from which loads of any shape are superposed.
"""

from dataclasses import dataclass
import math
from pathlib import Path

import numpy as np

from benchmarks.contact.fe_frames import Object, PROFILE, profiles, solve

POISSON = 0.45
BACKINGS = {'2mm': 2e-3, '3mm': 3e-3, '4mm': 4e-3, '6mm': 6e-3, '12mm': 12e-3, 'none': math.inf}
CYLINDER = 5e-3, 1e3  # radius [m], force [N/m]
NARROW = 0.15e-3  # radius or half width of a load that is used for superposition [m]
MORE_BACKINGS = 3e-3, 12e-3
SUPERPOSED = 3e-3, math.inf


@dataclass(frozen=True)
class Sunk(Object):
    """Object with a given indentation [m]."""

    sunk: float = 0.2e-3

    @property
    def indentation(self):
        """Indentation [m]."""
        return self.sunk


def cylinder(backing: float) -> np.ndarray:
    """Return the cylinder's profile at its force, found by iteration of the indentation."""
    radius, force = CYLINDER
    deep, record = 0.4e-3, None
    for _ in range(6):
        record = solve(Sunk('wedge', radius, deep), backing, POISSON)
        if abs(record['force'] / force - 1.0) < 0.02:
            break
        deep *= (force / float(record['force']))**0.7
    record['kind'] = 'cylinder'
    return record


def more_profiles(folder: Path) -> np.ndarray:
    """Return all PROFILE records; those not in `fe_frames` are solved once and stored."""
    file = folder / 'fe_more.npz'
    if not file.exists():
        rows = [cylinder(backing) for backing in BACKINGS.values()]
        rows += [solve(Object(kind, radius), backing, POISSON) for backing in MORE_BACKINGS
                 for kind, radii in (('ball', (0.5e-3, 1e-3, 2e-3, 3e-3)),
                                     ('wedge', (1e-3, 3e-3))) for radius in radii]
        rows += [solve(Object(kind, 1e-3), backing, POISSON)
                 for backing in (2e-3, 4e-3, math.inf) for kind in ('round punch', 'strip')]
        rows += [solve(Object(kind, NARROW), backing, POISSON)
                 for backing in SUPERPOSED for kind in ('round punch', 'strip')]
        file.parent.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(file, profiles=np.array(rows, PROFILE))
    return np.concatenate([profiles(), np.load(file)['profiles']])


def chosen(table: np.ndarray, kind: str, backing: float, poisson: float = POISSON, *,
           radius: float | None = None) -> np.ndarray:
    """
    Return PROFILE records of a kind of object on one skin.

    They have the given radius, or every radius except NARROW.
    """
    keep = (table['kind'] == kind) & (table['backing'] == backing) & (table['poisson'] == poisson)
    keep &= table['radius'] > 2.0 * NARROW if radius is None else table['radius'] == radius
    return table[keep]
