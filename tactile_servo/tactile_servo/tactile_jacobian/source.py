"""Where a servo takes the inverse of its tactile Jacobian from."""
from collections.abc import Callable

import numpy as np

from tactile_sensing.dome.geometry import Dome
from tactile_sensing.dome.half_space import HalfSpaceDome
from tactile_sensing.types.array import TactelArray
from tactile_servo.tactile_jacobian.features import FeatureKind, ModelFeatures
from tactile_servo.tactile_jacobian.jacobian import (
    Increments,
    least_squares,
    loading_cases,
    scale_for,
    TactileJacobian,
)
from tactile_servo.tactile_jacobian.table import build_table, Entry, grid, JacobianTable

TABLES = ('nearest', 'interpolated')
METHODS = ('constant', *TABLES, 'online')
SHARES = (0.2, 0.4, 0.7, 1.0, 1.5, 2.0)  # of the force, at which a table has contacts

Inverse = Callable[[np.ndarray], Entry]  # of the features (3,)


class ModelSource:
    """
    Inverses from the half-space on the dome's tangent plane, for one array and one force.

    'constant' is that of the contact at the pad's centre; 'nearest' and 'interpolated' come from
    a table of 6 x 6 contacts as in Figure 6.8, at some forces; 'online' is found for each image
    anew, at the contact that the one before has led to.
    """

    def __init__(self, dome: Dome, array: TactelArray, kind: FeatureKind, method: str,
                 force: float, stiffness: float, table: JacobianTable | None = None):
        self._increments = Increments(stiffness=stiffness)
        self._length = 0.5 * (array.half_width_x + array.half_width_y)
        self._half, self._force = np.array([array.half_width_x, array.half_width_y]), force
        self._scale = scale_for(kind, force, self._length, stiffness)
        self.features = ModelFeatures(HalfSpaceDome(dome, array), array, kind)
        if table is None and method in TABLES:
            contacts = grid(array.half_width_x, array.half_width_y, 6, force * np.array(SHARES))
            table = build_table(
                self.features, kind, contacts, self._increments, self._length, force)
        self._contact = np.array([0.0, 0.0, force])
        at_centre = Entry(self._least_squares(self._contact).inverse, 0.0, True)
        self.inverse: Inverse = self._online
        if method == 'constant':
            self.inverse = lambda features: at_centre
        elif table is not None and method in TABLES:
            self.inverse = table.nearest if method == 'nearest' else table.interpolated

    def _least_squares(self, contact: np.ndarray) -> TactileJacobian:
        return least_squares(loading_cases(self.features, contact, self._increments), self._scale)

    def _online(self, features: np.ndarray) -> Entry:
        """One step of Newton's method from the last contact, then the Jacobian there."""
        shown = self.features(self._contact)
        found = self._least_squares(self._contact)
        move = found.inverse @ (features - shown) * [1.0, 1.0, self._increments.stiffness]
        wanted = self._contact + move
        low = np.array([*-self._half, 0.05 * self._force])
        high = np.array([*self._half, 5.0 * self._force])
        if np.isfinite(wanted).all():
            self._contact = np.clip(wanted, low, high)
        return Entry(found.inverse, 0.0, True)
