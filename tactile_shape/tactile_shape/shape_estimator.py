"""Computes patches and a model of the object from contacts, with either surface estimator."""
from tactile_shape.contour.contact_path import Placed
from tactile_shape.contour.object_model import ObjectModel
from tactile_shape.local_surface.local_quadric import LocalQuadric
from tactile_shape.thesis.matrix_estimator import MatrixEstimator
from tactile_shape.types.patch import Kind, Patch, SurfaceEstimator

# By method; each is made from a LocalQuadricConfig.
ESTIMATORS = {kind.method: kind for kind in (LocalQuadric, MatrixEstimator)}


class ShapeEstimator:
    """Patches and the model of an object, updated with each contact."""

    def __init__(self, estimator: SurfaceEstimator):
        self._estimator, self.model = estimator, ObjectModel()

    def take(self, placed: Placed) -> Patch:
        """
        Process a contact placed by ContactPath; return the Patch there.

        A contact with an edge belongs to the contour, not to a surface: its Patch is invalid.
        """
        if placed.anew:
            self.lose()
        contact = placed.contact
        if contact is None:
            return Patch(Kind.NONE, False, placed.reason)
        if contact.edge:
            self._estimator.reset()
            self.model.add_contact(contact.position)
            return Patch(Kind.NONE, False, 'an edge: it has a contour, no surface')
        patch = self._estimator.update(contact.position, contact.normal)
        if patch.samples:  # otherwise the contact was not usable
            self.model.add_contact(contact.position)
            self.model.add_patch(patch)
        return patch

    def lose(self) -> None:
        """End the path after a loss of contact."""
        self._estimator.reset()
        self.model.begin_stroke()
