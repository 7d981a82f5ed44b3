"""
Finite-element pressure in a skin on bone that an object indents: reference for the estimator.

It shares no code with `tactile_sensing.skin`. Displacements are of second order on a graded mesh
of quadrilaterals: axisymmetric for balls and round punches, plane strain for wedges with a round
tip and flat strips. A rigid object is pressed in without friction. Penalties act where it touches;
this is repeated until the contact area no longer changes. `python -m benchmarks.contact.fe_frames`
writes the profiles of pressure at the depth of the tactels to fe_frames.npz; it needs scikit-fem.
"""

from dataclasses import dataclass
import math
from pathlib import Path

import numpy as np

DEPTH = 2e-3  # of the tactels [m]
MODULUS = 0.4e6  # Pa; about Shore A 10
BACKINGS = (math.inf, 10e-3, 8e-3, 6e-3, 4e-3, 2e-3)  # depth of the bone [m]
POISSONS = (0.3, 0.45, 0.49)
BALLS = (0.5e-3, 1e-3, 2e-3, 3e-3)  # radius [m]
WEDGES = (1e-3, 3e-3)  # radius of the tip [m]
PUNCHES = (2e-3, 3e-3)  # radius or half width [m]
RADII = np.concatenate([np.linspace(0.0, 8e-3, 161), np.linspace(8.1e-3, 36e-3, 100)])
THICK = 50e-3  # thickness that represents a skin without bone [m]
FILE = Path(__file__).with_name('fe_frames.npz')
KINDS = 'ball', 'wedge', 'round punch', 'strip'
# Kind of object, its radius or half width [m], depth of the bone [m], Poisson's ratio,
# indentation [m], force [N] or [N/m], half width of the contact area [m], pressure at RADII.
PROFILE = np.dtype([
    ('kind', 'U12'), ('radius', 'f8'), ('backing', 'f8'), ('poisson', 'f8'), ('indented', 'f8'),
    ('force', 'f8'), ('touching', 'f8'), ('pressure', 'f4', RADII.shape)])


@dataclass(frozen=True)
class Object:
    """A rigid body of revolution, or prism."""

    kind: str
    radius: float

    @property
    def round(self):
        """True for a body of revolution."""
        return self.kind in ('ball', 'round punch')

    def height(self, r):
        """Return the height of its surface above its lowest point [m]."""
        if self.kind in ('ball', 'wedge'):
            inside = np.minimum(r, 0.95 * self.radius)
            slope = inside / np.sqrt(self.radius**2 - inside**2)
            return self.radius - np.sqrt(self.radius**2 - inside**2) + slope * (r - inside)
        return np.where(r <= self.radius, 0.0, 1.0)

    @property
    def indentation(self):
        """Indentation [m]."""
        return {'ball': 0.25e-3, 'wedge': 0.2e-3}.get(self.kind, 0.2e-3)


def _graded(first, last, smallest, growth, largest):
    """Return places from first to last with increasing distances."""
    places, step = [first], smallest
    while places[-1] < last:
        places.append(places[-1] + step)
        step = min(step * growth, largest)
    return first + (np.array(places) - first) * (last - first) / (places[-1] - first)


def solve(shape: Object, backing: float, poisson: float, *, fine: float = 1.0) -> np.ndarray:
    """Solve the indentation by an object; return a PROFILE record. `fine` refines the mesh."""
    from skfem import (
        Basis,
        BilinearForm,
        condense,
        ElementQuad1,
        ElementQuad2,
        ElementVector,
        FacetBasis,
        LinearForm,
        MeshQuad,
    )
    from skfem import solve as solved
    from skfem.helpers import ddot, sym_grad, trace

    thickness = backing if backing < math.inf else THICK
    smallest = 0.06e-3 / fine
    r = np.concatenate([np.arange(0.0, 1.2e-3, smallest)[:-1],
                        _graded(1.2e-3, 60e-3, smallest, 1.07, 4e-3 / fine)])
    depth = np.concatenate([_graded(0.0, min(DEPTH, thickness), smallest, 1.12, 0.15e-3 / fine),
                            [] if thickness <= DEPTH else _graded(
                                DEPTH, thickness, 0.15e-3 / fine, 1.15, 4e-3 / fine)[1:]])
    mesh = MeshQuad.init_tensor(r, -depth[::-1])
    axis = 1.0 if shape.round else 0.0
    basis = Basis(mesh, ElementVector(ElementQuad2()), intorder=5)
    mu = MODULUS / (2.0 * (1.0 + poisson))
    lam = 2.0 * mu * poisson / (1.0 - 2.0 * poisson)

    @BilinearForm
    def stiffness(u, v, w):
        measure = 2.0 * np.pi * w.x[0] if axis else 1.0
        e, f = sym_grad(u), sym_grad(v)
        hoop_u = axis * u[0] / np.maximum(w.x[0], 1e-12)
        hoop_v = axis * v[0] / np.maximum(w.x[0], 1e-12)
        return measure * (lam * (trace(e) + hoop_u) * (trace(f) + hoop_v)
                          + 2.0 * mu * (ddot(e, f) + hoop_u * hoop_v))

    elastic = stiffness.assemble(basis)
    top = mesh.facets_satisfying(lambda x: (np.abs(x[1]) < 1e-9) & (x[0] < 6e-3))
    facets = FacetBasis(mesh, ElementVector(ElementQuad2()), facets=top, intorder=5)
    penalty = 2e3 * MODULUS / 1e-3

    @BilinearForm
    def contact(u, v, w):
        measure = 2.0 * np.pi * w.x[0] if axis else 1.0
        return penalty * w['touches'] * measure * u[1] * v[1]

    @LinearForm
    def pushed(v, w):
        measure = 2.0 * np.pi * w.x[0] if axis else 1.0
        return -penalty * w['touches'] * measure * w['gap'] * v[1]

    fixed = basis.get_dofs(lambda x: np.abs(x[1] + thickness) < 1e-9).all()
    middle = basis.get_dofs(lambda x: np.abs(x[0]) < 1e-12).all(['u^1'])
    held = np.unique(np.concatenate([fixed, middle]))
    places = facets.global_coordinates().value[0]
    reach = shape.indentation - shape.height(places)  # object below the undeformed skin
    touches = (reach > 0.5 * shape.indentation).astype(float)
    for _ in range(25):
        system = elastic + contact.assemble(facets, touches=touches)
        load = pushed.assemble(facets, touches=touches, gap=reach)
        u = solved(*condense(system, load, D=held))
        sunk = facets.interpolate(u)[1]
        into = reach + np.asarray(sunk)  # pressed where the object is below the skin
        now = (into > 0.0).astype(float)
        if (now == touches).all():
            break
        touches = now
    pressed = penalty * np.maximum(into, 0.0) * touches
    measure = 2.0 * np.pi * places if axis else 2.0 + 0.0 * places
    force = float((pressed * measure * facets.dx).sum())
    touching = float(places[touches > 0.0].max())

    # Stresses are most accurate at two Gauss points per side, above all in nearly incompressible
    # skin.
    best = Basis(mesh, ElementVector(ElementQuad2()), intorder=3)
    scalar = Basis(mesh, ElementQuad1(), intorder=3)
    field = best.interpolate(u)
    grad, where = field.grad, best.global_coordinates().value[0]
    hoop = axis * field.value[0] / np.maximum(where, 1e-12)
    stress = -(lam * (grad[0, 0] + grad[1, 1] + hoop) + 2.0 * mu * grad[1, 1])
    smooth = scalar.project(stress)
    at = np.stack([RADII, np.full_like(RADII, -min(DEPTH, thickness) + 1e-9)])
    values = scalar.probes(at) @ smooth
    record = np.zeros((), PROFILE)
    for name, value in (('kind', shape.kind), ('radius', shape.radius), ('backing', backing),
                        ('poisson', poisson), ('indented', shape.indentation), ('force', force),
                        ('touching', touching), ('pressure', values)):
        record[name] = value
    return record


def profiles() -> np.ndarray:
    """Return all stored profiles: PROFILE records."""
    return np.load(FILE)['profiles']


def main():
    """Solve and store every case."""
    objects = [Object('ball', radius) for radius in BALLS] + [
        Object('wedge', radius) for radius in WEDGES] + [
        Object(kind, radius) for kind in ('round punch', 'strip') for radius in PUNCHES]
    rows = [solve(shape, backing, poisson) for backing in BACKINGS for poisson in POISSONS
            for shape in objects]
    np.savez_compressed(FILE, profiles=np.array(rows, PROFILE))
    print(f'{FILE}: {len(rows)} profiles')


if __name__ == '__main__':
    main()
