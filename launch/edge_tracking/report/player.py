"""Data of a run for the page's player: images, contacts, path and states over time."""
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from edge_tracking.recording.frames_summary import force_series, force_unit
from edge_tracking.recording.run import RunData
from edge_tracking.web.page import levels, packed
from tactile_servo.types import State

MAX_BYTES = 1_500_000  # of the images in a page; others are omitted
MAX_RATE = 60.0  # images per second
MAX_POINTS = 5000  # of a path


class Shown(NamedTuple):
    """A recording with its summary, and scene and truth if they are known."""

    name: str
    run: RunData
    summary: dict[str, Any]
    scene: Any = None  # Scene
    real: Any = None  # Course


class Stage(NamedTuple):
    """A time during which the servo's state and reason did not change."""

    begin: int  # stamps [ns]
    end: int
    state: State
    reason: str


def stages(run: RunData) -> list[Stage]:
    """Return the states and reasons of the servo in sequence."""
    stamps, state, reason = run.statuses.stamp_ns, run.statuses.state, run.statuses.reason
    if not len(stamps):
        return []
    changed = 1 + np.flatnonzero((state[1:] != state[:-1]) | (reason[1:] != reason[:-1]))
    return [Stage(int(stamps[first]), int(stamps[min(after, len(stamps) - 1)]),
                  State(int(state[first])), str(reason[first]))
            for first, after in pairwise([0, *changed, len(stamps)])]


def thinned(count: int, most: int) -> np.ndarray:
    """Return at most `most` evenly spaced indices of a series."""
    return np.unique(np.linspace(0, max(count - 1, 0), min(count, most)).round().astype(int))


def chosen(run: RunData, pages: int = 1) -> np.ndarray:
    """Return the stamps [ns] that a player shows; those of images if there are any."""
    images, stamps = run.images, run.images.stamp_ns
    if not len(stamps):
        return run.poses.stamp_ns[thinned(len(run.poses.stamp_ns), MAX_POINTS)]
    each = images.frames[0].size + 36
    seconds = 1e-9 * float(stamps[-1] - stamps[0])
    return stamps[thinned(len(stamps), int(min(
        MAX_BYTES / pages // each, max(MAX_RATE * seconds, 10.0))))]


def _newest(known: np.ndarray, stamps: np.ndarray) -> np.ndarray:
    """Return the index of the newest known value at each stamp, -1 before the first."""
    return np.searchsorted(known, stamps, side='right') - 1


def _at(known: np.ndarray, values: np.ndarray, stamps: np.ndarray) -> np.ndarray:
    """Return the newest values at stamps, NaN before the first."""
    return np.concatenate([values, np.full((1, *values.shape[1:]), np.nan)])[
        _newest(known, stamps)]


def player(run: RunData, stamps: np.ndarray) -> dict[str, Any]:
    """Return the data of a run at some stamps [ns] for the script `player.js`, as JSON types."""
    images, contacts, found = run.images, run.contacts, stages(run)
    array, series = images.array, force_series(run)
    frames = images.frames[_newest(images.stamp_ns, stamps)] if array else images.frames[:0]
    top = float(np.nanmax(frames, initial=0.0))
    placed = np.column_stack([contacts.x, contacts.y, contacts.yaw])
    placed[~contacts.valid] = np.nan
    centre = ~contacts.valid & (contacts.type > 0)
    placed[centre, :2] = contacts.centre_of_pressure[centre]
    touched = run.touches.position if len(run.touches.stamp_ns) else run.contour
    force = _at(series.stamp_ns, series.force, stamps)
    scale, unit = force_unit(series.unit)
    return {
        'rows': array.rows if array else 0, 'columns': array.columns if array else 0,
        'pitch': [float(array.pitch_x), float(array.pitch_y)] if array else [1.0, 1.0],
        'top': top, 'levels': packed(levels(frames, top), 'u1'),
        'time': packed(run.seconds(stamps), '<f4'),
        'contact': packed(_at(contacts.stamp_ns, placed, stamps), '<f4'),
        'force': packed(force, '<f4'), 'force_scale': scale, 'unit': unit,
        'path': packed(_at(run.poses.stamp_ns, run.poses.position, stamps), '<f4'),
        'touched': packed(touched[thinned(len(touched), MAX_POINTS)], '<f4'),
        'stages': [[stage.state.name.lower(), stage.reason] for stage in found],
        'stage': packed(_newest(np.array([stage.begin for stage in found], np.int64), stamps),
                        '<i4'),
        'first': int(np.nanargmax(force)) if np.isfinite(force).any() else 0}
