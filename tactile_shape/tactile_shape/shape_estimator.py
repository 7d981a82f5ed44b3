"""From contacts in space to patches and a model of the object, with either surface estimator."""
from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np

from tactile_common.config import bounded, check_fields, one_of
from tactile_shape.contour.contact_path import Placed
from tactile_shape.contour.object_model import ObjectModel
from tactile_shape.local_surface import local_quadric
from tactile_shape.local_surface.local_quadric import LocalQuadric, LocalQuadricConfig
from tactile_shape.surface_matrix import matrix_estimator
from tactile_shape.surface_matrix.matrix_estimator import MatrixEstimator, MatrixEstimatorConfig
from tactile_shape.types.patch import Patch, refusal

METHODS = (local_quadric.METHOD, matrix_estimator.METHOD)


class SurfaceEstimator(Protocol):
    """Surface at the newest of the contacts of a path."""

    def reset(self) -> None:
        """Forget the path: contact was lost."""

    def add(self, position: np.ndarray, normal: np.ndarray) -> bool:
        """Add a contact (3,) [m] with its inward normal (3,); False if it is not usable."""

    def estimate(self) -> Patch:
        """Patch at the newest contact; what cannot be estimated is not valid."""

    def update(self, position: np.ndarray, normal: np.ndarray) -> Patch:
        """Add a contact and return the Patch there."""


@dataclass(frozen=True)
class ShapeEstimatorConfig:
    """How contacts become patches."""

    method: str = one_of(
        local_quadric.METHOD, "'local_quadric' (least model over a window of travel) or "
        "'surface_matrix' (the thesis' ten parameters)", METHODS)
    max_gap: float = bounded(
        0.1, 'contacts farther apart in time are not of one path; poses of the sensor are not '
        'interpolated across more', 's', 1e-4, 100.0)

    def __post_init__(self):
        check_fields(self)


def make_surface_estimator(method: str, config: LocalQuadricConfig) -> SurfaceEstimator:
    """Return the estimator of a method, with what it knows of a LocalQuadricConfig."""
    if method == local_quadric.METHOD:
        return LocalQuadric(config)
    shared = {item.name for item in fields(MatrixEstimatorConfig)} & {
        item.name for item in fields(LocalQuadricConfig)}
    return MatrixEstimator(MatrixEstimatorConfig(
        **{name: getattr(config, name) for name in shared}))


class ShapeEstimator:
    """
    Patches and the model of an object, contact by contact.

    Parameters
    ----------
    estimator : SurfaceEstimator
    model : ObjectModel, optional

    Attributes
    ----------
    model : ObjectModel
    """

    def __init__(self, estimator: SurfaceEstimator, model: ObjectModel | None = None):
        self._estimator = estimator
        self.model = model or ObjectModel()

    def take(self, placed: Placed) -> Patch:
        """Take in what a ContactPath has placed; returns the Patch there."""
        if placed.anew:
            self.lose()
        if placed.contact is None:
            return refusal(placed.reason)
        contact = placed.contact
        return self.touch(contact.position, contact.normal, contact.edge)

    def lose(self, reason: str = 'nothing is touched') -> Patch:
        """Contact is lost: the next begins a new path. Returns a Patch that is not valid."""
        self._estimator.reset()
        self.model.begin_stroke()
        return refusal(reason)

    def touch(self, position: np.ndarray, normal: np.ndarray, edge: bool = False) -> Patch:
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
            return refusal('an edge: it has a contour, no surface')
        patch = self._estimator.update(position, normal)
        if patch.samples:  # else the contact was not usable
            self.model.add_contact(position)
            self.model.add_patch(patch)
        return patch
