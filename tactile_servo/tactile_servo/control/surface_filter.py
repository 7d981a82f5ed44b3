"""Estimate of the surface around the contact: depth of the probe, normal, curvature."""
import numpy as np

_ROWS, _COLUMNS = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])  # of BEND in K
DEPTH, NORMAL, BEND = 0, slice(1, 4), slice(4, 10)  # of the state
IDENTITY = np.eye(10)
INEXACT = 0.1  # relative error of a depth from the force
DEPTH_NOISE = 4e-6  # m, error of a depth from one image, including the robot's position
CURVATURE_CHANGE = 10.0  # 1/m, standard deviation of the change of a curvature over 1 m
PRIOR_CURVATURE = 25.0  # 1/m, standard deviation before the first contact: radius 40 mm
MISTRUST = 0.5  # share of the motion along the normal by which the predicted depth may be wrong
SURPRISE = 40.0  # chi-square of an image's four numbers above which it shows another surface


class SurfaceFilter:
    """
    Kalman filter of the depth h, the inward normal n and the curvature K of a probe's centre.

    The centre of a round probe that keeps its force moves on a surface of its own, h = 0. For a
    displacement dc of the centre the depth is h + n dc + dc' K dc / 2, and the normal is the
    gradient n + K dc. For a plane, a cylinder or a sphere this normal is exact at any distance,
    with the same symmetric K in the base frame. The force gives h within a few micrometres. In the
    direction of travel it therefore determines the normal far better than the contact's position
    on the pad does; across it, that position determines the normal.
    """

    def __init__(self) -> None:
        self._begun = False
        self.centre = np.zeros(3)  # position of the centre to which the state belongs [m]
        self._state, self._covariance = np.zeros(10), np.zeros((10, 10))
        self.bend = np.zeros((3, 3))  # K [1/m]

    @property
    def normal(self) -> np.ndarray:
        """Inward unit normal (3,) at `centre`."""
        return self._state[NORMAL]

    def update(self, depth: float, normal: np.ndarray, centre: np.ndarray, noise: float) -> None:
        """
        Update with depth [m] and normal (3,) at a centre (3,) [m]; noise of normal [rad].

        The first image begins a surface, and so does one at an edge or on another surface.
        """
        felt = np.concatenate([[depth], normal])
        errors = np.array([DEPTH_NOISE**2 + (INEXACT * depth)**2] + [noise**2] * 3)
        if not (self._begun and self._correct(felt, errors, centre - self.centre)):
            self._state = np.concatenate([felt, np.zeros(6)])
            self._covariance = np.diag([*errors, *[PRIOR_CURVATURE**2] * 6])
        self._begun, self.centre = True, centre
        self.bend = np.empty((3, 3))
        self.bend[_ROWS, _COLUMNS] = self.bend[_COLUMNS, _ROWS] = self._state[BEND]

    def _correct(self, felt: np.ndarray, errors: np.ndarray, step: np.ndarray) -> bool:
        """Correct the state after a step (3,) of the centre; return False on another surface."""
        way = float(np.sqrt(step @ step))
        transition = IDENTITY.copy()
        transition[NORMAL, BEND] = along = _along(step)
        transition[DEPTH, NORMAL] = step
        transition[DEPTH, BEND] = 0.5 * step @ along
        state = transition @ self._state
        covariance = transition @ self._covariance @ transition.T
        change = CURVATURE_CHANGE**2 * way  # variance of a curvature
        spread = np.repeat([(MISTRUST * (self.normal @ step))**2, 0.3 * change * way**2, change],
                           [1, 3, 6])
        covariance[range(10), range(10)] += spread
        innovation, expected = felt - state[:4], covariance[:4, :4] + np.diag(errors)
        if float(innovation @ np.linalg.solve(expected, innovation)) > SURPRISE:
            return False
        gain = np.linalg.solve(expected, covariance[:4]).T
        self._state = state + gain @ innovation
        keep = IDENTITY.copy()
        keep[:, :4] -= gain
        self._covariance = keep @ covariance @ keep.T + (gain * errors) @ gain.T
        self._state[NORMAL] /= np.sqrt(self.normal @ self.normal)
        return True

    def predict(self, centre: np.ndarray) -> tuple[float, np.ndarray]:
        """Predict depth [m] and unit normal (3,) for the centre at a position (3,) [m]."""
        step = centre - self.centre
        change = self.bend @ step
        normal = self.normal + change
        depth = self._state[DEPTH] + float(step @ (self.normal + 0.5 * change))
        return depth, normal / np.sqrt(normal @ normal)

    def bend_std(self, way: np.ndarray) -> float:
        """Return the standard deviation of the curvature along a unit vector (3,) [1/m]."""
        six = way @ _along(way)
        return float(np.sqrt(max(six @ self._covariance[BEND, BEND] @ six, 0.0)))


def _along(step: np.ndarray) -> np.ndarray:
    """Return the Jacobian (3, 6) of the normal by the six elements of K, for a step (3,)."""
    x, y, z = step
    return np.array([[x, 0.0, 0.0, y, z, 0.0], [0.0, y, 0.0, x, 0.0, z],
                     [0.0, 0.0, z, 0.0, x, y]])
