"""Table of the surface at every contact of a recording."""
from collections import Counter
from collections.abc import Iterator
import re
from typing import NamedTuple

import numpy as np

from tactile_shape.contact_recording import ContactRecording
from tactile_shape.contour.contact_path import Placed, SpatialContact
from tactile_shape.shape_estimator import ShapeEstimator
from tactile_shape.types.patch import Kind

MANY = 0.9  # share of patches with both curvatures negative that gives a hint
# Parts of a reason that differ from contact to contact.
_NUMBERS = re.compile(
    '^the path of [^ ]+ mm is |^[0-9]+ contacts see |, not all of .*|: they scatter by .*')


class Column(NamedTuple):
    """Column of the table: its type, unit and meaning."""

    kind: str
    unit: str
    text: str


COLUMNS = {
    't': Column('f8', 's', 'time of the contact'),
    'origin': Column('3f8', 'm', 'contact on the fitted surface'),
    'frame': Column('(4,4)f8', 'm', 'pose of the contact frame: x, y principal directions, z '
                    'inward normal'),
    'kind': Column('u1', '', 'least surface that explains the path; see Kinds'),
    'valid': Column('?', '', 'whether the row may be used'),
    'curvature': Column('2f8', '1/m', 'principal curvatures, the larger in magnitude first, '
                        'positive for convex'),
    'seen': Column('2?', '', 'whether the path could see each; if not, it is a prior'),
    'directions': Column('(2,3)f8', '', 'principal directions, a row each'),
    'covariance': Column('(2,2)f8', '1/m^2', 'of the curvatures'),
    'surface_matrix': Column('(4,4)f8', 'm', "S of X' S X = 0, X = [x y z 1]', in the frame of "
                             'the positions'),
    'n': Column('u4', '', 'contacts used'),
    'window': Column('f8', 'm', 'length of the path that was used'),
    'residual': Column('f8', '', 'RMS in standard deviations'),
}
_ATTRIBUTES = {'n': 'samples', 'window': 'extent'}  # of a patch, where the names differ
KINDS = {
    Kind.NONE: 'not determined: the row is not valid', Kind.PLANE: 'plane',
    Kind.CYLINDER: 'cylinder: curved in one direction', Kind.SPHERE: 'sphere',
    Kind.GENERAL: 'curved differently in the two directions'}


class PatchTable:
    """Table of the surface at every contact of a recording."""

    def __init__(self, recording: ContactRecording, estimator: ShapeEstimator):
        self._recording, self._estimator = recording, estimator
        self.records = np.zeros(len(recording), [
            (name, column.kind) for name, column in COLUMNS.items()])
        self.records['t'] = recording.t
        self._reasons: Counter[str] = Counter()  # number of invalid patches by reason

    def fill(self) -> Iterator[int]:
        """Fit the surface at each contact in sequence; yields the number of contacts done."""
        recording = self._recording
        for k, (position, normal, edge) in enumerate(zip(
                recording.position, recording.normal, recording.edge, strict=True)):
            lost = bool(np.isnan(position).any())
            contact = None if lost else SpatialContact(position, normal, edge)
            patch = self._estimator.take(Placed(None, contact, lost, 'nothing is touched'))
            for name in COLUMNS.keys() - {'t'}:
                self.records[name][k] = getattr(patch, _ATTRIBUTES.get(name, name))
            if not patch.valid:
                self._reasons[_NUMBERS.sub('', patch.reason)] += 1
            yield k + 1

    def __str__(self) -> str:
        """Return the number of patches of each kind with their median curvatures."""
        valid = self.records[self.records['valid']]
        parts = []
        for kind in Kind:
            some = valid[valid['kind'] == kind]
            if len(some):
                one, other = np.median(some['curvature'], axis=0)
                parts.append(f'{len(some)} {kind.name.lower()} ({one:.4g}, {other:.4g} 1/m)')
        parts.append(f'{len(self.records) - len(valid)} not valid' + ''.join(
            f'; {count} {reason}' for reason, count in self._reasons.items()))
        return ', '.join(parts)

    def hint(self, window: float) -> str:
        """Return a probable mistake in the units or signs of the input; empty if none shows."""
        position = self._recording.position
        steps = np.linalg.norm(np.diff(position, axis=0), axis=1)
        if (step := np.nanmedian(steps) if np.isfinite(steps).any() else 0.0) > window:
            return (f'contacts are {step:.3g} m apart, more than the window of {window:g} m; are '
                    'positions in metres?')
        seen = self.records[self.records['valid'] & self.records['seen'].all(axis=1)]
        if len(seen) and (seen['curvature'].max(axis=1) < 0.0).mean() > MANY:
            return ('the surface is concave nearly throughout; if the object is convex, the '
                    'normals point out of it and must point into it')
        return ''
