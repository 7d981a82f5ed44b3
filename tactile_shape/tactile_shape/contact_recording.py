"""A recorded path of contacts, read from arrays in a file or from the topics of a bag."""
from collections.abc import Iterable
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tactile_common.command_line import reading_bags
from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import clear_errors, read_arrays
from tactile_shape.contour.contact_path import ContactPath

if TYPE_CHECKING:
    from tactile_sensing.observations import BagMessage

NEEDED = ('contact', 'sensor_pose')  # topics; 'image' (bends and ends of edges) may be missing
SETTINGS = ('finger_radius', 'position_noise', 'normal_noise', 'location_noise')


@dataclass(frozen=True, eq=False)
class ContactRecording:
    """
    Contacts in order of time, in a frame in which the object is at rest.

    Raises
    ------
    ConfigurationError
        A shape or type is wrong, time decreases or is not finite, or no position is finite.
    """

    t: np.ndarray  # (N,), not decreasing [s]
    position: np.ndarray  # (N, 3) [m]; NaN without contact
    normal: np.ndarray  # (N, 3), the object's inward unit normal
    # (N,), contacts with an edge: they belong to the outline, not to the surface.
    edge: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))

    def __post_init__(self) -> None:
        count = len(self.t) if np.ndim(self.t) == 1 else 0
        for name, shape in (('t', (count,)), ('position', (count, 3)), ('normal', (count, 3))):
            value = np.asarray(getattr(self, name))
            if value.shape != shape or not count:
                wanted = '(N,), N above 0' if name == 't' else f'{shape} as t is {(count,)}'
                raise ConfigurationError(f'{name} has shape {value.shape}, must be {wanted}')
            if value.dtype.kind not in 'uif':
                raise ConfigurationError(f'{name} is of type {value.dtype}, must be real numbers')
            object.__setattr__(self, name, value.astype(float))
        if not len(self.edge):
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

    def __len__(self) -> int:
        return len(self.t)


def load_contacts(path: str | PathLike, namespace: str | None = None,
                  finger_radius: float = 0.0) -> ContactRecording:
    """
    Read an `.npz` file, or a rosbag2 recording of `contact`, `sensor_pose` and optionally `image`.

    Parameters
    ----------
    namespace : str, optional
        Namespace of the sensor in a bag; not needed if the bag has only one sensor.
    finger_radius : float, optional
        Locates contacts of a bag on a round finger [m]; 0 is a flat pad.

    Raises
    ------
    ConfigurationError
        The file cannot be read, or data in it are missing or invalid.
    """
    path = Path(path)
    if not path.exists():
        raise ConfigurationError(f'{path}: there is no such file')
    if path.suffix.lower() != '.npz':
        return _from_bag(path, namespace, finger_radius)
    arrays = read_arrays(path, ('t', 'position', 'normal'), SETTINGS)
    if held := [name for name in SETTINGS if name in arrays]:
        raise ConfigurationError(f'{path}: holds {", ".join(held)}, but fit takes settings from '
                                 'its options alone')
    with clear_errors(path):
        return ContactRecording(**arrays)


def _from_bag(path: Path, namespace: str | None, finger_radius: float) -> ContactRecording:
    with reading_bags():  # imports message types, which are not needed for arrays
        from tactile_common.ros.bag_reader import Bag
        from tactile_sensing.observations import observations, TYPES
    with Bag(path) as bag:
        prefix = bag.namespace_of({name: TYPES[name] for name in NEEDED}, namespace)
        rows = _place_contacts(observations(
            bag, {f'{prefix}/{name}': name for name in (*NEEDED, 'image')}), finger_radius)
    if not rows:
        raise ConfigurationError(f'bag {path}: no contact with a pose of the sensor at its stamp')
    with clear_errors(path):
        return ContactRecording(*map(np.array, zip(*rows, strict=True)))


def _place_contacts(observations: Iterable['BagMessage'], finger_radius: float) -> list[tuple]:
    """Return time, position, normal and edge of each contact; NaN marks a loss of contact."""
    path, lost, nowhere = ContactPath(finger_radius), True, np.full(3, np.nan)
    rows: list[tuple] = []
    for seen in observations:
        placed = []
        if seen.kind == 'image':
            path.add_picture(seen.stamp_ns, seen.value)
        elif seen.kind == 'sensor_pose':
            placed = path.add_pose(seen.stamp_ns, seen.value())
        else:
            placed = path.add_contact(seen.stamp_ns, seen.value(), seen.stamp_ns)
        for stamp_ns, contact, anew, _ in placed:
            if anew and not lost:
                rows.append((1e-9 * stamp_ns, nowhere, nowhere, False))
                lost = True
            if contact is not None:
                rows.append((1e-9 * stamp_ns, contact.position, contact.normal, contact.edge))
                lost = False
    return rows
