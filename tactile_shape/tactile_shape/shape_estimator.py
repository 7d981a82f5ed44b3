"""From contacts in space to patches and a model of the object, with either estimator."""
from dataclasses import dataclass, field, fields

import numpy as np

from tactile_common.config import check_fields
from tactile_common.errors import ConfigurationError
from tactile_shape.contour.object_model import ObjectModel
from tactile_shape.local_surface.local_quadric import LocalQuadric, LocalQuadricConfig
from tactile_shape.surface_matrix.matrix_estimator import MatrixEstimator, MatrixEstimatorConfig
from tactile_shape.types.patch import Kind, Patch

METHODS = ('local_quadric', 'surface_matrix')


@dataclass(frozen=True)
class TrackerConfig:
    """How contacts become patches."""

    method: str = field(default='local_quadric', metadata={
        'doc': "'local_quadric' (least model over a window of travel) or 'surface_matrix' (the "
               "thesis' ten parameters)"})
    max_gap: float = field(default=0.1, metadata={
        'doc': 'contacts farther apart in time are not of one path; poses of the sensor are not '
               'interpolated across more', 'unit': 's', 'range': (1e-4, 100.0)})

    def __post_init__(self):
        check_fields(self)
        if self.method not in METHODS:
            raise ConfigurationError(f'method: {self.method!r} is not one of {METHODS}')


def make_estimator(method, config):
    """Return the estimator of a method, with what it knows of a LocalQuadricConfig."""
    if method == METHODS[0]:
        return LocalQuadric(config)
    shared = {item.name for item in fields(MatrixEstimatorConfig)} & {
        item.name for item in fields(LocalQuadricConfig)}
    return MatrixEstimator(MatrixEstimatorConfig(
        **{name: getattr(config, name) for name in shared}))


class ShapeTracker:
    """
    Patches and the model of an object, contact by contact.

    Parameters
    ----------
    estimator : LocalQuadric or MatrixEstimator
    model : ObjectModel, optional

    Attributes
    ----------
    model : ObjectModel
    """

    def __init__(self, estimator, model=None):
        self._estimator = estimator
        self.model = model or ObjectModel()

    def take(self, placed):
        """Take in what a ContactPath has placed; returns the Patch there."""
        if placed.anew:
            self.lose()
        if placed.contact is None:
            return no_patch(placed.reason)
        contact = placed.contact
        return self.touch(contact.position, contact.normal, contact.edge)

    def lose(self, reason='nothing is touched'):
        """Contact is lost: the next begins a new path. Returns a Patch that is not valid."""
        self._estimator.reset()
        self.model.begin_stroke()
        return no_patch(reason)

    def touch(self, position, normal, edge=False):
        """
        Take in a contact and return the Patch there; of an edge, one that is not valid.

        Parameters
        ----------
        position, normal : ndarray, shape (3,)
            Contact [m] and the object's inward unit normal.
        edge : bool
            Whether it is a contact with an edge: it makes the contour, and no surface.
        """
        if edge:
            self._estimator.reset()
            if np.isfinite(position).all():
                self.model.add_contact(position)
            return no_patch('an edge: it has a contour, no surface')
        patch = self._estimator.update(position, normal)
        if patch.samples:  # else the contact was not usable
            self.model.add_contact(position)
            self.model.add_patch(patch)
        return patch


def no_patch(reason):
    """Patch that is not valid, and why."""
    return Patch(Kind.NONE, False, reason, '')
