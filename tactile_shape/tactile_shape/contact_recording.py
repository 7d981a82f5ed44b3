"""A recorded path of contact: from arrays in a file, or from the topics of a bag."""
from dataclasses import dataclass, replace
import math
from pathlib import Path
import zipfile
import zlib

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_shape.contour.contact_path import ContactPath

OPTIONAL = ('finger_radius', 'position_noise', 'normal_noise', 'location_noise')


@dataclass(frozen=True, eq=False)
class Trace:
    """
    Contacts in the order of time.

    Parameters
    ----------
    t : ndarray, shape (N,)
        Time, not falling [s].
    position, normal : ndarray, shape (N, 3)
        Contact [m] and the object's inward unit normal, in a frame in which the object is at
        rest; NaN where nothing is touched.
    edge : ndarray of bool, shape (N,), optional
        Contacts with an edge: they make the outline, and no surface.
    finger_radius, position_noise, normal_noise, location_noise : float, optional
        As in `LocalQuadricConfig`; None where the recording does not say.

    Raises
    ------
    ConfigurationError
        A shape or a type is wrong, time falls or is not finite, or nothing is touched.
    """

    t: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    edge: np.ndarray | None = None
    finger_radius: float | None = None
    position_noise: float | None = None
    normal_noise: float | None = None
    location_noise: float | None = None

    def __post_init__(self):
        count = len(self.t) if np.ndim(self.t) == 1 else 0
        for name, shape in (('t', (count,)), ('position', (count, 3)), ('normal', (count, 3))):
            value = np.asarray(getattr(self, name))
            if value.shape != shape or not count:
                wanted = '(N,), N above 0' if name == 't' else f'{shape} as t is {(count,)}'
                raise ConfigurationError(f'{name} has shape {value.shape}, must be {wanted}')
            if value.dtype.kind not in 'uif':
                raise ConfigurationError(f'{name} is of type {value.dtype}, must be real numbers')
            object.__setattr__(self, name, value.astype(float))
        if self.edge is None:
            object.__setattr__(self, 'edge', np.zeros(count, bool))
        if not np.isfinite(self.t).all():
            raise ConfigurationError('t: a number is not finite')
        falls = np.flatnonzero(np.diff(self.t) < 0.0)
        if len(falls):
            raise ConfigurationError(
                f't falls from row {falls[0]} to {falls[0] + 1}: {self.t[falls[0]]} to '
                f'{self.t[falls[0] + 1]} s')
        if not np.isfinite(self.position).all(axis=1).any():
            raise ConfigurationError('position: no row is finite')

    def __len__(self):
        return len(self.t)


def load_trace(path, namespace=None, finger_radius=None):
    """
    Read a trace: an `.npz` file, or a rosbag2 recording of `contact` and `sensor_pose`.

    Parameters
    ----------
    path : str or os.PathLike
    namespace : str, optional
        Of the sensor in a bag; may be left out where there is one.
    finger_radius : float, optional
        In place of what the file says; a bag says nothing, which means a flat pad [m].

    Raises
    ------
    ConfigurationError
        The file cannot be read, or something in it is missing or impossible.
    """
    path = Path(path)
    try:
        if not path.exists():
            raise ConfigurationError('there is no such file')
        if path.suffix == '.npz':
            trace = _from_arrays(path)
            return trace if finger_radius is None else replace(
                trace, finger_radius=finger_radius)
        from tactile_shape.bag import read_bag  # knows messages, which arrays do not need
        return read_bag(path, namespace, finger_radius or 0.0)
    except ConfigurationError as error:
        raise ConfigurationError(f'{path}: {error}') from error
    except OSError as error:
        raise ConfigurationError(f'{path}: cannot be read: {error.strerror or error}') from error


def _from_arrays(path):
    try:
        with np.load(path, allow_pickle=False) as archive:
            for name in ('t', 'position', 'normal'):
                if name not in archive:
                    raise ConfigurationError(
                        f'array {name!r} is missing, there are {sorted(archive.files)}')
            arrays = {name: archive[name] for name in ('t', 'position', 'normal')}
            known = {name: _scalar(name, archive[name]) for name in OPTIONAL if name in archive}
    except ConfigurationError:
        raise
    except (ValueError, EOFError, zipfile.BadZipFile, zlib.error, MemoryError) as error:
        raise ConfigurationError('is not an .npz archive of numbers, or damaged') from error
    return Trace(**arrays, **known)


def _scalar(name, value):
    if value.size != 1 or value.dtype.kind not in 'uif' or not math.isfinite(value.item()):
        raise ConfigurationError(f'{name} is {value.tolist()!r:.60}, must be one finite number')
    return float(value.item())


def place_contacts(events, finger_radius=0.0):
    """
    Trace of contacts and poses as they were received.

    Parameters
    ----------
    events : iterable of (int, ndarray or None, Contact or None, TactileImage or None)
        Stamp [ns], and either a pose (4, 4) of the sensor or a contact on the pad, with its
        picture if there is one.
    finger_radius : float
        As of `contact_path.on_pad` [m].

    Returns
    -------
    Trace
        With NaN where contact was lost.
    """
    path = ContactPath(finger_radius)
    rows = []
    lost = np.full(3, np.nan)
    for stamp, pose, contact, picture in events:
        placed = (path.add_contact(stamp, contact, stamp, picture) if pose is None
                  else path.add_pose(stamp, pose))
        for at, spatial, anew, _ in placed:
            if anew and rows and not np.isnan(rows[-1][1][0]):
                rows.append((1e-9 * at, lost, lost, False))
            if spatial is not None:
                rows.append((1e-9 * at, spatial.position, spatial.normal, spatial.edge))
    if not rows:
        raise ConfigurationError('no contact with a pose of the sensor at its stamp')
    t, position, normal, edge = (np.array(column) for column in zip(*rows, strict=True))
    return Trace(t, position, normal, edge, finger_radius=finger_radius)
