"""Computes patches and a model of the object from contacts, with either surface estimator."""
import numpy as np

from tactile_shape.contour.contact_path import Placed
from tactile_shape.contour.object_model import ObjectModel
from tactile_shape.local_surface.local_quadric import LocalQuadric
from tactile_shape.thesis.matrix_estimator import MatrixEstimator
from tactile_shape.types.patch import Patch, refusal, SurfaceEstimator

# By method; each is made from a LocalQuadricConfig.
ESTIMATORS = {kind.method: kind for kind in (LocalQuadric, MatrixEstimator)}


class ShapeEstimator:
    """Patches and the model of an object, updated with each contact."""

    def __init__(self, estimator: SurfaceEstimator):
        self._estimator, self.model = estimator, ObjectModel()

    def take(self, placed: Placed) -> Patch:
        """Process a contact placed by ContactPath; return the Patch there."""
        if placed.anew:
            self.lose()
        if placed.contact is None:
            return refusal(placed.reason)
        contact = placed.contact
        return self.touch(contact.position, contact.normal, contact.edge)

    def lose(self) -> Patch:
        """End the path after a loss of contact; return an invalid Patch."""
        self._estimator.reset()
        self.model.begin_stroke()
        return refusal('nothing is touched')

    def touch(self, position: np.ndarray, normal: np.ndarray, edge: bool = False) -> Patch:
        """
        Process a contact (3,) [m] with the object's inward normal (3,); return the Patch there.

        A contact with an edge belongs to the contour, not to a surface: its Patch is invalid.
        """
        if edge:
            self._estimator.reset()
            if np.isfinite(position).all():
                self.model.add_contact(position)
            return refusal('an edge: it has a contour, no surface')
        patch = self._estimator.update(position, normal)
        if patch.samples:  # otherwise the contact was not usable
            self.model.add_contact(position)
            self.model.add_patch(patch)
        return patch
