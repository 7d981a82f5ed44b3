"""
Least-squares fit of a plane, sphere, cylinder or general surface at a contact.

In a tangent frame with inward normal n and u = (x, y), any plane, sphere or cylinder satisfies

    -n_xy = b + K u    and    z (1 + n_z) / 2 = a + b u + u' K u / 2

however large the arc. Both equations are linear in the height a, the slope b and the curvature K.
"""
import math
from typing import NamedTuple

import numpy as np

from tactile_shape.types.patch import Kind, PRIOR_CURVATURE
from tactile_shape.types.tangent import Principal, principal_curvatures, turn_about_z

PASSES = 3  # the weights depend on K and no longer change after three passes
ENOUGH = 10  # number of cells needed to estimate the noise from residuals
# A path's length or width counts if its variance is at least this multiple of the variance of the
# noise: three standard deviations.
CLEAR = 9.0
# Departure of a general surface from a second-order one, as a share of its third-order term; gives
# distant contacts less weight.
MODEL_ERROR = 0.1
# Approximate number of the six parameters that heights alone determine, or one component of the
# normals
_SPENT = 2.0
# Values of chi-square that 1 % of samples exceed, for 1, 2 and 3 degrees of freedom.
LEVELS = (0.0, 6.635, 9.210, 11.345)
_ALIKE = np.array([1.0, 0.0, 1.0])  # (K11, K12, K22) of a sphere


class Noise(NamedTuple):
    """Standard deviations of one contact, in [m] and for the normal in [rad]."""

    position: float
    location: float  # of errors along the surface
    normal: float
    height: float  # in addition to position


class CurvatureFit(NamedTuple):
    """Simplest model of the contacts; height and slope are in the frame `axes`."""

    kind: Kind  # NONE if the path is too short to show any curvature
    axes: np.ndarray  # (3, 3), tangent frame with x along the path
    height: float  # a [m]
    slope: np.ndarray  # b, (2,)
    principal: Principal
    covariance: np.ndarray  # (2, 2), of the principal curvatures
    seen: np.ndarray  # (2,), variance of each from the data alone
    along: float  # variance of the curvature along the path
    residual: float  # RMS in standard deviations
    scatter: float  # standard deviation of positions from the surface, at least the given one [m]


class Fitter:
    """
    Least-squares fit of contacts (m, 3) with their normals and weights in a tangent frame.

    The first `count` of (K11, K12, K22) are fitted; the others keep their prior. The position
    noise is increased to the scatter of the heights. Height and slope are eliminated: they are the
    last column of `lift` (3, 4) minus its other columns times K. `information` (3, 3) is the
    inverse covariance of K, `right` (3,) is its product with K.
    """

    def __init__(self, points: np.ndarray, normals: np.ndarray, weights: np.ndarray, noise: Noise,
                 count: int):
        self._points, self._normals, self._weights = points, normals, weights
        self.noise, self._count = noise, count
        # Coefficients of a, b1, b2, K11, K12, K22 and right side, for three equations per
        # contact: one for its height, two for its normal.
        self._rows = rows = np.zeros((3, len(points), 7))
        x, y, z = points.T
        rows[0, :, 0] = rows[1, :, 1] = rows[2, :, 2] = 1.0
        rows[0, :, 1] = rows[1, :, 3] = rows[2, :, 4] = x
        rows[0, :, 2] = rows[1, :, 4] = rows[2, :, 5] = y
        rows[0, :, 3], rows[0, :, 4], rows[0, :, 5] = 0.5 * x * x, x * y, 0.5 * y * y
        rows[0, :, 6] = 0.5 * z * (1.0 + normals[:, 2])
        rows[1:, :, 6] = -normals[:, :2].T
        self._solve(np.zeros(3), np.zeros(3))
        for _ in range(PASSES - 1 if count else 0):
            covariance = np.linalg.inv(self.information)
            curvature = covariance @ self.right
            self.noise = noise._replace(position=self._scatter(curvature, noise.position))
            self._solve(curvature, np.diag(covariance))

    def _weigh(self, curvature: np.ndarray, doubt: np.ndarray, model_error: float) -> np.ndarray:
        """
        Return the rows over their covariance (3, m, 7).

        Through the curvature (3,) and its uncertainty, the variances `doubt` (3,), a displacement
        along the surface causes an error of the normal. `model_error` is relative to the
        third-order term |K u|^3 of normal and height.
        """
        k11, k12, k22 = curvature.tolist()
        noise, (x, y, z), n = self.noise, self._points.T, self._normals
        lean, up = (n[:, :2]**2).sum(axis=1), np.maximum(n[:, 2], 0.1)
        turn = (k11 * x + k12 * y)**2 + (k12 * x + k22 * y)**2
        unlike = self._weights * model_error**2 * turn
        # For a shift along the surface, changes of height and slope cancel to second order.
        left_over = 0.5 * (1.0 - up) / up
        height = (noise.position**2 * (lean + 0.25 * (1.0 + up)**2) + noise.height**2
                  + noise.location**2 * lean * left_over**2 + unlike * turn * z**2)
        slide = noise.position**2 + noise.location**2
        normal = noise.normal**2 + unlike * turn**2
        s11 = normal + slide * (k11 * k11 + k12 * k12 + doubt[0] + doubt[1])
        s22 = normal + slide * (k12 * k12 + k22 * k22 + doubt[1] + doubt[2])
        s12 = slide * k12 * (k11 + k22)
        weights = self._weights / (s11 * s22 - s12 * s12)
        of_height, first, second = self._rows
        return np.stack([
            (self._weights / height)[:, None] * of_height,
            (weights * s22)[:, None] * first - (weights * s12)[:, None] * second,
            (weights * s11)[:, None] * second - (weights * s12)[:, None] * first])

    @property
    def curvature(self) -> np.ndarray:
        """Fitted (K11, K12, K22), ndarray (3,)."""
        return np.linalg.solve(self.information, self.right)

    def flat(self, curvature: np.ndarray) -> np.ndarray:
        """Return height and slope, ndarray (3,), for a curvature (3,)."""
        return self._lift[:, 3] - self._lift[:, :3] @ curvature

    def allow_third_order(self) -> None:
        """Fit again: the surface may differ from second order by `MODEL_ERROR`."""
        for _ in range(2):
            self._solve(self.curvature, self._doubt, MODEL_ERROR)

    def excess(self) -> tuple[float, float]:
        """
        Return by how much the squared residuals exceed their expectation, and their RMS.

        The first value is at least 1 and that of the normals: unexplained residuals are noise.
        """
        freedom = 3 * len(self._points) - 3 - self._count
        if freedom < 1:
            return 1.0, math.nan
        left = max(float(self._of_plane - self.right @ self.curvature), 0.0) / freedom
        return max(1.0, left, self._excess_of_normals()), math.sqrt(left)

    def _excess_of_normals(self) -> float:
        """
        Return the excess of the normals' squared errors in the worse of the principal directions.

        Successive contacts may have similar errors, for instance those of a filter. With the
        correlation r of successive errors only the share (1 - r) / (1 + r) of them counts.
        """
        if len(self._points) < ENOUGH:
            return 1.0
        curvature = self.curvature
        unknowns = np.array([*-self.flat(curvature), *-curvature, 1.0])
        # In these directions the two components of an error are independent.
        turn = turn_about_z(principal_curvatures(*curvature.tolist())[2])[:2, :2].T
        errors, weighted = turn @ (self._rows[1:] @ unknowns), turn @ (
            self._weighted[1:] @ unknowns)
        scaled = np.sign(errors) * np.sqrt(np.abs(errors * weighted))  # [standard deviations]
        squares = (scaled ** 2).sum(axis=1) + 1e-300
        r = (scaled[:, 1:] * scaled[:, :-1]).sum(axis=1) / squares
        return float((squares * (1.0 + r) / (1.0 - r)).max()) / (len(self._points) - _SPENT)

    def _solve(self, curvature: np.ndarray, doubt: np.ndarray, model_error: float = 0.0) -> None:
        self._doubt = doubt
        self._weighted = self._weigh(curvature, doubt, model_error)
        # The normal equations (7, 7)
        sums = self._rows.reshape(-1, 7).T @ self._weighted.reshape(-1, 7)
        self._lift = np.linalg.solve(sums[:3, :3], sums[:3, 3:])
        left = sums[3:, 3:] - sums[3:, :3] @ self._lift
        for unseen in range(self._count, 3):
            left[unseen] = left[:, unseen] = 0.0
            left[unseen, unseen] = 1.0 / PRIOR_CURVATURE**2
        # `_of_plane`: chi-square of K = 0
        self.information, self.right, self._of_plane = left[:3, :3], left[:3, 3], left[3, 3]

    def _scatter(self, curvature: np.ndarray, known: float) -> float:
        """Return the standard deviation of positions [m], larger if heights scatter more."""
        weights, heights = self._weights, self._rows[0]
        if len(weights) < ENOUGH:
            return known
        residual = heights[:, 6] - heights[:, :6] @ [*self.flat(curvature), *curvature]
        return max(known, math.sqrt(weights @ residual**2 / (len(weights) - _SPENT)))


def fit_curvature(points: np.ndarray, normals: np.ndarray, weights: np.ndarray,
                  axes: np.ndarray, noise: Noise) -> CurvatureFit:
    """
    Fit the simplest model to contacts (m, 3), each the mean of `weights` (m,) samples.

    The points are relative to the origin of the tangent frame, whose `axes` (3, 3) are columns x,
    y and the inward normal. `noise` is that of one sample.
    """
    turn, count = _path_frame(
        points @ axes[:, :2], weights, math.hypot(noise.position, noise.location))
    axes = axes @ turn
    fitter = Fitter(points @ axes, normals @ axes, weights, noise, count)
    kind, curvature, residual, excess = Kind.NONE, np.zeros(3), math.nan, 1.0
    if count:
        excess, residual = fitter.excess()
        kind, curvature = least_model(fitter.information / excess, fitter.right / excess, count)
        if kind == Kind.GENERAL:
            fitter.allow_third_order()
            curvature = fitter.curvature
            excess, residual = fitter.excess()
    information, flat = fitter.information / excess, fitter.flat(curvature)
    one, other, heading = principal_curvatures(*curvature.tolist())
    main = Principal(one, 0.0 if kind == Kind.CYLINDER else other,
                     heading if kind in (Kind.CYLINDER, Kind.GENERAL) else 0.0)
    # An unseen curvature does not become certain by the choice of a cylinder.
    covariance, seen = curvature_covariance(
        kind if count == 3 else Kind.GENERAL, information, main)
    return CurvatureFit(kind, axes, flat[0], flat[1:], main, covariance, seen,
                        np.linalg.inv(information)[0, 0], residual, fitter.noise.position)


def _path_frame(u: np.ndarray, weights: np.ndarray, std: float) -> tuple[np.ndarray, int]:
    """Return the rotation (3, 3) of x along a path (m, 2), and how many of K it determines."""
    off = u - weights @ u / weights.sum()
    spread = (weights[:, None] * off).T @ off / weights.sum()
    large, small, heading = principal_curvatures(spread[0, 0], spread[0, 1], spread[1, 1])
    # Noise of `std` [m] along the surface makes a path look wider. Without a path, its direction
    # would be that of rounding errors.
    fuzz = CLEAR * std**2 * len(weights) / weights.sum() + 1e-24
    count = 0 if large < fuzz else 2 if small < fuzz else 3
    return turn_about_z(heading if count else 0.0), count


def along(heading: float) -> np.ndarray:
    """Return (K11, K12, K22) for curvature 1 along a heading [rad] and 0 across it."""
    c, s = math.cos(heading), math.sin(heading)
    return np.array([c * c, c * s, s * s])


def _best(information: np.ndarray, right: np.ndarray,
          form: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the best curvature of a form (3,) and its reduction of chi-square."""
    share, stiffness = form @ right, form @ information @ form
    return share / stiffness * form, share**2 / stiffness


def _best_heading(information: np.ndarray, right: np.ndarray) -> float:
    """Return the heading of the cylinder that reduces chi-square most [rad]."""
    # With t the tangent of the heading, the reduction is p(t)^2 / q(t). At its maximum
    # 2 p' q = p q', a polynomial of degree 4.
    p, i = right[::-1], information
    q = np.array([i[2, 2], 2.0 * i[1, 2], i[1, 1] + 2.0 * i[0, 2], 2.0 * i[0, 1], i[0, 0]])
    stationary = (2.0 * np.convolve(p[:2] * [2.0, 1.0], q)
                  - np.convolve(p, q[:4] * [4.0, 3.0, 2.0, 1.0]))
    headings = [0.5 * math.pi, *np.arctan(np.roots(stationary[1:]).real).tolist()]
    return max(headings, key=lambda heading: _best(information, right, along(heading))[1])


def least_model(information: np.ndarray, right: np.ndarray,
                count: int) -> tuple[Kind, np.ndarray]:
    """
    Choose the simplest of plane, sphere, cylinder and general that chi-square does not reject.

    `information` (3, 3) and `right` (3,) are the normal equations of (K11, K12, K22), of which the
    first `count` were seen. Returns the kind and the curvature (3,).
    """
    full = np.linalg.solve(information, right)
    most = full @ right
    if most < LEVELS[count]:
        return Kind.PLANE, np.zeros(3)
    form = along(_best_heading(information, right))
    cylinder, by_cylinder = _best(information, right, form)
    if count < 3:
        # A cylinder gives the curvature across the path from the other two, provided that it
        # depends little on the unseen element.
        return (Kind.CYLINDER, cylinder) if form[0] > 0.5 else (Kind.GENERAL, full)
    sphere, by_sphere = _best(information, right, _ALIKE)
    sphere_gap, cylinder_gap = most - by_sphere, most - by_cylinder
    if sphere_gap < LEVELS[2] and sphere_gap < cylinder_gap + LEVELS[1]:
        return Kind.SPHERE, sphere
    return (Kind.CYLINDER, cylinder) if cylinder_gap < LEVELS[1] else (Kind.GENERAL, full)


def curvature_covariance(kind: Kind, information: np.ndarray,
                         found: Principal) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the covariance (2, 2) of the principal curvatures and their variances (2,).

    The variances come from the data alone. The covariance also uses them for curvatures that the
    model fixes.
    """
    covariance = np.linalg.inv(information)
    form, across = along(found.heading), along(found.heading + 0.5 * math.pi)
    both = np.array([form, across]) * [1.0, 2.0, 1.0]
    free = both @ covariance @ both.T
    seen = np.diag(free).copy()
    if kind == Kind.SPHERE:
        return np.full((2, 2), 1.0 / (_ALIKE @ information @ _ALIKE)), seen
    if kind == Kind.GENERAL:
        return free, seen
    if kind == Kind.CYLINDER:
        c, s = math.cos(found.heading), math.sin(found.heading)
        turn = found.first * np.array([-2.0 * c * s, c * c - s * s, 2.0 * c * s])
        both = np.array([form, turn])  # per curvature and per angle
        (kk, ka), (_, aa) = both @ information @ both.T
        seen_of_it = 1.0 / (kk - ka * ka / aa) if aa > 0.0 else 1.0 / kk
        return np.diag([seen_of_it, seen[1]]), seen
    return np.diag(seen), seen
