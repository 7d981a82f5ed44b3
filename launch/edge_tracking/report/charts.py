"""Data of a run for the page: its charts, and the images and states of its player."""
from collections.abc import Sequence
from typing import Any

import numpy as np

from edge_tracking.recording import summary as of_run
from edge_tracking.recording.run import RunData
from edge_tracking.recording.summary import held, newest, Shown
from edge_tracking.web.page import levels, packed
from tactile_common.polyline import arc_length
from tactile_common.ros.conversions import name_in
from tactile_sensing.types.contact import ContactType
from tactile_servo.track_statistics import SETTLING_LENGTH
from tactile_servo.types import State
from tactile_shape.contour.outline import Outline

BLUE, ORANGE, GREY, INK, EDGE_COLOUR = '#1f5fa8', '#d4691e', '#7a808a', '#22262b', '#c9cdd4'
MOST_POINTS = 4000  # per line; longer ones show smallest and largest value of each group
MAX_BYTES = 1_500_000  # of the images in a page; others are omitted
MAX_RATE = 60.0  # images per second
LEAST_ERROR = 5e-3  # mm, smallest range of an axis of errors
SHADES: dict[int, str] = {
    State.APPROACH: '#eaf0f8', State.CORNER: '#fff4d6', State.SEARCH: '#fdebd3',
    State.RETREAT: '#dfe7ef', State.HOLD: '#fadcd9'}
CORNERS = np.array([[-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1]])  # x and y of a closed square
TOUCH, TRUE = (ORANGE, '#c9a227'), (BLUE, '#6aa3d8')  # along x and y


def line(name: str, points: Any, colour: str, **style: Any) -> dict[str, Any]:
    """Return a line through points, x and y, NaN for gaps; `style` is its width, or dots."""
    x, y = extremes(*(np.asarray(part, float) for part in points))
    return {'name': name, 'colour': colour, 'x': packed(x, '<f4'), 'y': packed(y, '<f4'), **style}


def extremes(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reduce a long line to the smallest and largest value of each group, which keeps peaks."""
    size = -(-2 * len(y) // MOST_POINTS)
    if size <= 2:
        return x, y
    groups = np.append(y, np.full(-len(y) % size, np.nan)).reshape(-1, size)
    missing = np.isnan(groups)
    both = np.column_stack([np.where(missing, np.inf, groups).argmin(axis=1),
                            np.where(missing, -np.inf, groups).argmax(axis=1)])
    index = (np.sort(both, axis=1) + size * np.arange(len(groups))[:, None]).ravel()
    return x[index], y[index]


def chart(title: str, x: str, y: str, series: Sequence[Any], **more: Any) -> dict[str, Any]:
    """
    Return a chart of results of `line` for the script `chart.js`.

    `x` and `y` are labels with units. `more` may be `bands` [begin, end, colour], `marks` [across,
    at, name, colour], `domain` of x, `range` of y, `equal` axes.
    """
    return {'title': title, 'xlabel': x, 'ylabel': y, 'series': [*series], **more}


def _place_on_pad(it: Shown) -> np.ndarray:
    """Return the true place (N, 2) of the edge or surface on the pad [m]; NaN means unknown."""
    real = it.real
    if it.scene.action == 'track_surface':
        return real.place
    along = np.einsum(
        'ij,ij->i', it.run.poses.matrix[:, :3, 1], it.scene.edge.tangent_at(real.along))
    left = 1.0 if along[real.tracking].sum() >= 0.0 else -1.0  # side of the sensor's x
    lateral = np.where(real.tracking, -left * real.lateral, np.nan)
    return np.column_stack([lateral, np.full_like(lateral, np.nan)])


def over_time(it: Shown) -> list[dict[str, Any]]:
    """Return charts of the contact's place on the pad, measured and true, and of the force."""
    run, statuses, real = it.run, it.run.statuses, it.real
    time = run.seconds(statuses.stamp_ns)
    tracking, settled = of_run.settled_cycles(statuses)
    felt = np.column_stack([statuses.lateral_error, statuses.longitudinal_error])
    felt = np.where(tracking[:, None], 1e3 * felt, np.nan)
    series = [line(f'{"xy"[axis]} by touch', (time, felt[:, axis]), TOUCH[axis])
              for axis in (0, 1) if np.isfinite(felt[:, axis]).any()]
    judged = felt[settled]
    if it.scene:
        place = _place_on_pad(it)
        judged = 1e3 * place[real.settled]
        series += [line(f'{"xy"[axis]}, true', (real.time, 1e3 * place[:, axis]), TRUE[axis],
                        width=1.8)
                   for axis in (0, 1) if np.isfinite(place[:, axis]).any()]
    begin = [[True, float(time[np.argmax(settled)]), '', GREY]] if settled.any() else []
    active = time[statuses.state != State.IDLE]
    bands = [[float(run.seconds(stage.begin)), float(run.seconds(stage.end)), SHADES[stage.state]]
             for stage in of_run.stages(run) if stage.state in SHADES]
    common = {'bands': bands, 'domain': active[[0, -1]].tolist() if np.ptp(active) else None}
    off = 'off centre [mm]'
    return [
        chart("What is followed, from the pad's centre", 'time [s]', off, series, marks=begin,
              **common),
        chart('The same, enlarged to what remains after settling', 'time [s]', off, series,
              range=_around(judged), marks=begin, **common),
        {**_force(it, begin), **common}]


def _around(values: np.ndarray) -> list[float] | None:
    """Return the range of an axis for settled errors [mm]."""
    seen = np.abs(values[np.isfinite(values)])
    most = 1.3 * max(float(seen.max()), LEAST_ERROR) if seen.size else 0.0
    return [-most, most] if most else None


def _force(it: Shown, begin: list[Any]) -> dict[str, Any]:
    run, contacts, real = it.run, it.run.contacts, it.real
    (scale, unit), felt = of_run.shown_unit(of_run.force_unit(run)), of_run.loads_of(run)
    stamps, force = felt.stamp_ns, felt.m0
    touching = contacts.type != ContactType.NONE
    if 2 * contacts.force_valid[touching].sum() > touching.sum():
        stamps = contacts.stamp_ns
        force = np.where(contacts.force_valid, contacts.normal_force, np.nan)
    series = [line('by touch', (run.seconds(stamps), scale * force), ORANGE)]
    if real is not None:
        series.append(line('true', (real.time, real.force), BLUE, width=1.8))
    target = float(it.summary['force_target'])
    known = np.isfinite(target) and unit == 'N'
    largest = max(target, float(np.nanmax(force if real is None else real.force, initial=target)))
    return chart('Force on the pad', 'time [s]', f'force [{unit}]', series,
                 marks=[*begin, [False, target, f'target, {target:g} N', INK]] if known else begin,
                 range=[-0.04 * target, 1.2 * largest] if known else None)


def latency(it: Shown) -> list[dict[str, Any]]:
    """Return a histogram of the time from an image's last byte to the command that used it."""
    values, summary = 1e3 * of_run.latencies(it.run), it.summary
    period = 1e3 / summary['sensor_rate'] if summary['sensor_rate'] > 0 else np.nan
    right = 1.1 * float(np.nanmax([0.0, period, np.percentile(values, 99.8)]))
    left = min(0.0, float(values.min()))
    counts, edges = np.histogram(np.clip(values, left, right), np.linspace(left, right, 80))
    marks = [[True, float(at), text, colour] for at, text, colour in (
        (1e3 * summary['latency_p50'], 'median', INK), (1e3 * summary['latency_p99'], '99 %',
                                                        ORANGE),
        (period, 'one picture', GREY)) if np.isfinite(at)]
    return [chart('Last byte to command', 'time [ms]', 'pictures', [
        line('', (np.repeat(edges, 2)[1:-1], np.repeat(counts, 2)), BLUE)], marks=marks)]


def from_above(edge: np.ndarray, points: Any) -> np.ndarray:
    """Return horizontal coordinates [mm], `(2, N)`, with the first edge from 0 along x."""
    along = edge[1, :2] - edge[0, :2]
    along = along / max(np.linalg.norm(along), 1e-12)
    across = np.array([-along[1], along[0]])
    relative = 1e3 * (np.asarray(points)[:, :2] - edge[0, :2])
    return (relative @ np.stack([along, across], axis=1)).T


def felt(it: Shown) -> list[dict[str, Any]]:
    """Return the contacts on a surface from above, and their distance from the true surface."""
    points = it.run.touches.matrix[:, :3, 3]
    off = it.scene.surface.distance(points) if len(points) else np.empty(0)
    return [
        chart('Contacts from above, equal axes', 'x [mm]', 'y [mm]', [
            line('', 1e3 * (points - np.array(it.scene.surface.top)).T[:2], BLUE, dots=True)],
            equal=True),
        chart('Contacts against the true surface', 'way [mm]', 'outside [\u00b5m]', [
            line('', (1e3 * arc_length(points) if len(points) else [], 1e6 * off), BLUE)])]


def plan(it: Shown, found: Outline | None) -> list[dict[str, Any]]:
    """Return the rebuilt outline from above; in a scene also true edge, pad and distances."""
    run, scene, series = it.run, it.scene, []
    if scene is not None:
        edge = scene.edge.points
        pad = run.poses.matrix[it.real.tracking, :3, 3]
        series += [line('true edge', from_above(edge, edge), EDGE_COLOUR, width=6),
                   line('pad', from_above(edge, pad), BLUE)]
    if found is not None:
        edge = found.points if scene is None else edge
        series += [line(name, from_above(edge, points.reshape(-1, 3)), colour, **style)
                   for name, points, colour, style in (
                       ('contacts', run.contour, TRUE[1], {'dots': True}),
                       ('outline', found.points, ORANGE, {}),
                       ('corners', found.corners, INK, {'dots': True}))]
    shown = [chart('Seen along base z, equal axes', 'along the first edge [mm]', 'across [mm]',
                   series, equal=True)]
    if scene and found is not None:
        lateral, along = 1e3 * scene.edge.nearest(run.contour)[0], arc_length(run.contour)
        shown.append(chart(
            'Contacts against the true edge', 'along the contour [mm]', 'left of it [mm]',
            [line('', (1e3 * along, lateral), BLUE)],
            range=_around(lateral[along >= SETTLING_LENGTH])))
    return shown


def curvatures(run: RunData) -> list[dict[str, Any]]:
    """Return the principal curvatures along the contact's path, where it shows them."""
    along = 1e3 * arc_length(np.array([patch.origin for patch in run.patches]))
    bend = np.array([np.where(patch.seen, patch.curvature, np.nan) for patch in run.patches])
    return [chart('Curvature, where the path could see it', 'way [mm]', 'curvature [1/m]', [
        line(('first', 'second')[axis], (along, bend[:, axis]), (BLUE, ORANGE)[axis], dots=True)
        for axis in (0, 1)])]


def pressed(run: RunData) -> list[dict[str, Any]]:
    """Return the force, and the centre of pressure over time and on the array."""
    (scale, unit), series = of_run.shown_unit(of_run.force_unit(run)), of_run.loads_of(run)
    time, centre = run.seconds(series.stamp_ns), 1e3 * series.centre_of_pressure
    loaded = series.m0 > 0.1 * np.nanmax(series.m0, initial=0.0)
    moves = np.where(loaded[:, None], centre, np.nan)
    array = run.images.array
    frame = [line('array', (500.0 * array.size_x * CORNERS[0], 500.0 * array.size_y * CORNERS[1]),
                  GREY)] if array else []
    return [
        chart('Force', 'time [s]', f'force [{unit}]', [
            line('', (time, scale * series.m0), BLUE)]),
        chart('Centre of pressure', 'time [s]', 'place [mm]', [
            line('xy'[axis], (time, moves[:, axis]), (BLUE, ORANGE)[axis]) for axis in (0, 1)]),
        chart('Centre of pressure on the array, equal axes', 'x [mm]', 'y [mm]', [
            *frame, line('', centre[loaded].T, BLUE, dots=True)], equal=True)]


def thinned(count: int, most: int) -> np.ndarray:
    """Return at most `most` evenly spaced indices of a series."""
    return np.unique(np.linspace(0, max(count - 1, 0), min(count, most)).round().astype(int))


def chosen(run: RunData, pages: int = 1) -> np.ndarray:
    """Return the stamps [ns] that a player shows; those of images if there are any."""
    images, stamps = run.images, run.images.stamp_ns
    if not len(stamps):
        return run.poses.stamp_ns[thinned(len(run.poses.stamp_ns), MOST_POINTS)]
    each = images.frames[0].size + 36
    seconds = 1e-9 * float(stamps[-1] - stamps[0])
    return stamps[thinned(len(stamps), int(min(
        MAX_BYTES / pages // each, max(MAX_RATE * seconds, 10.0))))]


def player(run: RunData, stamps: np.ndarray) -> dict[str, Any]:
    """Return the data of a run at some stamps [ns] for the script `player.js`, as JSON types."""
    images, contacts, found = run.images, run.contacts, of_run.stages(run)
    array, series = images.array, of_run.loads_of(run)
    frames = images.frames[newest(images.stamp_ns, stamps)] if array else images.frames[:0]
    top = float(np.nanmax(frames, initial=0.0))
    placed = np.column_stack([contacts.x, contacts.y, contacts.yaw])
    placed[~contacts.valid] = np.nan
    centre = ~contacts.valid & (contacts.type > 0)
    placed[centre, :2] = contacts.centre_of_pressure[centre]
    touched = run.touches.matrix[:, :3, 3] if len(run.touches) else run.contour
    force = held(series.stamp_ns, series.m0, stamps, np.nan)
    scale, unit = of_run.shown_unit(of_run.force_unit(run))
    return {
        'rows': array.rows if array else 0, 'columns': array.columns if array else 0,
        'pitch': [float(array.pitch_x), float(array.pitch_y)] if array else [1.0, 1.0],
        'top': top, 'levels': packed(levels(frames, top), 'u1'),
        'time': packed(run.seconds(stamps), '<f4'),
        'contact': packed(held(contacts.stamp_ns, placed, stamps, np.nan), '<f4'),
        'force': packed(force, '<f4'), 'force_scale': scale, 'unit': unit,
        'path': packed(held(
            run.poses.stamp_ns, run.poses.matrix[:, :3, 3], stamps, np.nan), '<f4'),
        'touched': packed(touched[thinned(len(touched), MOST_POINTS)], '<f4'),
        'stages': [[name_in(State, stage.state), stage.reason] for stage in found],
        'stage': packed(newest(np.array([stage.begin for stage in found], np.int64), stamps),
                        '<i4'),
        'first': int(np.nanargmax(force)) if np.isfinite(force).any() else 0}
