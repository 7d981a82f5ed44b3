"""What may be wrong with a recorded path of which hardly a surface could be told."""
from collections.abc import Iterator

import numpy as np

from tactile_shape.contact_recording import ContactRecording

MANY = 0.5  # of the contacts with a surface, that must be refused for a hint
UNIT = 1e-2  # that the length of a normal may be off
SHORT = 4e-3  # m of path, below which most patches are refused


def hints(recording: ContactRecording, records: np.ndarray, window: float) -> Iterator[str]:
    """
    Questions to the user, none if most contacts gave a valid patch.

    Parameters
    ----------
    records : ndarray
        Of `patch_table.RECORD`, a row per contact.
    window : float
        Length of path that a patch is fitted to [m].
    """
    touched = np.isfinite(recording.position).all(axis=1) & ~recording.edge
    count, valid = np.count_nonzero(touched), records['valid'][touched]
    if not count:
        if recording.edge.any():
            yield 'all contacts are with edges, which have no surface: see --outline, --contour'
        return
    seen = records['curvature'][touched][valid & records['seen'][touched].all(axis=1)]
    if len(seen) > MANY * count and (seen < 0.0).all():
        yield ('the surface is concave throughout; if the object is convex, the normals point '
               'out of it and must point into it')
    if np.count_nonzero(valid) >= (1.0 - MANY) * count:
        return
    yield f'{count - np.count_nonzero(valid)} of {count} contacts gave no surface'
    yield from _reasons(recording.position[touched], recording.normal[touched], window)


def _reasons(position: np.ndarray, normal: np.ndarray, window: float) -> Iterator[str]:
    length = np.median(np.linalg.norm(normal, axis=1))
    if not abs(length - 1.0) < UNIT:
        yield (f'normals have a length of {length:.3g}, must have 1'
               + ('; are position and normal exchanged?' if np.allclose(
                   np.linalg.norm(position, axis=1), 1.0, atol=UNIT) else ''))
        return
    steps = np.linalg.norm(np.diff(position, axis=0), axis=1)
    step, way = (np.median(steps), steps.sum()) if len(steps) else (0.0, 0.0)
    if step > window:
        yield (f'contacts are {step:.3g} m apart, more than the window of {window:g} m; are '
               'positions in metres?')
    elif way < SHORT:
        yield f'the whole path is {1e3 * way:.2g} mm long: below 4 mm hardly anything is seen'
    else:
        yield ('if the path is straight, swing it by 1 mm or more; if it is not of one surface, '
               'take a shorter --window; if positions are noisier than '
               '--position-noise, tell it')
