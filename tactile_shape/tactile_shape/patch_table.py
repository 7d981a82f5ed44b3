"""Table of the surface at every contact of a recording."""
from collections import Counter
from collections.abc import Callable, Iterator
import re
from typing import Any, NamedTuple

import numpy as np

from tactile_shape.contact_recording import ContactRecording
from tactile_shape.shape_estimator import ShapeEstimator
from tactile_shape.types.patch import Kind, Patch

MANY = 0.5  # share of the contacts with a surface; if more are refused, hints are given
UNIT_ERROR = 1e-2  # largest difference of a unit vector's length from 1
SHORT_PATH = 4e-3  # m; shorter paths show hardly any curvature
# Parts of a reason that differ from contact to contact.
_NUMBERS = re.compile(
    '^the path of [^ ]+ mm is |^[0-9]+ contacts see |, not all of .*|: they scatter by .*')


class Column(NamedTuple):
    """Column of the table: type, shape, how to get it from a patch, unit and meaning."""

    kind: Any
    shape: tuple[int, ...]
    value: Callable[[Patch], Any] | None  # None: not from the patch
    unit: str
    text: str


COLUMNS = {
    't': Column(float, (), None, 's', 'time of the contact'),
    'origin': Column(float, (3,), lambda p: p.origin, 'm', 'contact on the fitted surface'),
    'frame': Column(
        float, (4, 4), lambda p: p.frame, 'm',
        'pose of the contact frame: x, y principal directions, z inward normal'),
    'kind': Column(np.uint8, (), lambda p: p.kind, '',
                   'least surface that explains the path; see Kinds'),
    'valid': Column(np.bool_, (), lambda p: p.valid, '', 'whether the row may be used'),
    'curvature': Column(
        float, (2,), lambda p: p.curvature, '1/m',
        'principal curvatures, the larger in magnitude first, positive for convex'),
    'seen': Column(np.bool_, (2,), lambda p: p.seen, '',
                   'whether the path could see each; if not, it is a prior'),
    'directions': Column(float, (2, 3), lambda p: p.directions, '',
                         'principal directions, a row each'),
    'covariance': Column(float, (2, 2), lambda p: p.covariance, '1/m^2', 'of the curvatures'),
    'surface_matrix': Column(float, (4, 4), lambda p: p.surface_matrix, 'm',
                             "S of X' S X = 0, X = [x y z 1]', in the frame of the positions"),
    'n': Column(np.uint32, (), lambda p: p.samples, '', 'contacts used'),
    'window': Column(float, (), lambda p: p.extent, 'm', 'length of the path that was used'),
    'residual': Column(float, (), lambda p: p.residual, '', 'RMS in standard deviations'),
}
RECORD = np.dtype([(name, column.kind, column.shape) for name, column in COLUMNS.items()])
KINDS = {
    Kind.NONE: 'not determined: the row is not valid', Kind.PLANE: 'plane',
    Kind.CYLINDER: 'cylinder: curved in one direction', Kind.SPHERE: 'sphere',
    Kind.GENERAL: 'curved differently in the two directions'}


class PatchTable:
    """Table of the surface at every contact of a recording."""

    def __init__(self, recording: ContactRecording, estimator: ShapeEstimator):
        self._recording, self._estimator = recording, estimator
        self.records = np.zeros(len(recording), RECORD)
        self.records['t'] = recording.t
        self._reasons: Counter[str] = Counter()  # number of invalid patches by reason

    def fill(self) -> Iterator[int]:
        """Fit the surface at each contact in sequence; yields the number of contacts done."""
        recording = self._recording
        for k, (position, normal, edge) in enumerate(zip(
                recording.position, recording.normal, recording.edge, strict=True)):
            if np.isnan(position).any():
                patch = self._estimator.lose()
            else:
                patch = self._estimator.touch(position, normal, edge)
            for name, column in COLUMNS.items():
                if column.value is not None:
                    self.records[name][k] = column.value(patch)
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

    def hints(self, window: float) -> Iterator[str]:
        """Yield probable causes if most contacts gave no patch; `window` [m] is the fit's."""
        recording = self._recording
        touched = np.isfinite(recording.position).all(axis=1) & ~recording.edge
        records = self.records[touched]
        count, valid = len(records), np.count_nonzero(records['valid'])
        if not count:
            if recording.edge.any():
                yield ('all contacts are with edges, which have no surface: see --outline, '
                       '--contour')
            return
        seen = records['curvature'][records['valid'] & records['seen'].all(axis=1)]
        if len(seen) > MANY * count and (seen < 0.0).all():
            yield ('the surface is concave throughout; if the object is convex, the normals point '
                   'out of it and must point into it')
        if valid < (1.0 - MANY) * count:
            yield f'{count - valid} of {count} contacts gave no surface'
            yield _doubt(recording.position[touched], recording.normal[touched], window)


def _doubt(position: np.ndarray, normal: np.ndarray, window: float) -> str:
    """Return what is unusual about a path for which no surface could be determined."""
    length = np.median(np.linalg.norm(normal, axis=1))
    if not abs(length - 1.0) < UNIT_ERROR:
        exchanged = np.allclose(np.linalg.norm(position, axis=1), 1.0, atol=UNIT_ERROR)
        return (f'normals have a length of {length:.3g}, must have 1'
                + ('; are position and normal exchanged?' if exchanged else ''))
    steps = np.linalg.norm(np.diff(position, axis=0), axis=1)
    if len(steps) and (step := np.median(steps)) > window:
        return (f'contacts are {step:.3g} m apart, more than the window of {window:g} m; are '
                'positions in metres?')
    if (way := steps.sum()) < SHORT_PATH:
        return (f'the whole path is {1e3 * way:.2g} mm long: below {1e3 * SHORT_PATH:g} mm hardly '
                'anything is seen')
    return ('if the path is straight, swing it by 1 mm or more; if it is not of one surface, take '
            'a shorter --window; if positions are noisier than --position-noise, increase it')
