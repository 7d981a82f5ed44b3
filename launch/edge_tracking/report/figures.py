"""What happened along the edge of a scene over time: errors, force, pictures, latency."""
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from edge_tracking.recording.run import RunData
from edge_tracking.recording.summary import latencies, settled_cycles
from edge_tracking.report import style
from tactile_sensing.types.contact import ContactType
from tactile_servo.types import State
from tactile_simulation.edge_world import EdgeScene, EdgeTruth
from tactile_simulation.plot import BLUE, GREY, INK, label, new_figure, note, ORANGE

_SHADES = {
    State.APPROACH: ('#eaf0f8', 'approach'), State.CORNER: ('#fff4d6', 'corner'),
    State.SEARCH: ('#fdebd3', 'search'), State.RETREAT: ('#eaf0f8', 'lift off'),
    State.HOLD: ('#fadcd9', 'hold'), State.TRACK: (None, 'track'),
}


def errors(run: RunData, summary: Mapping[str, Any], scene: EdgeScene, real: EdgeTruth) -> Figure:
    """Lateral error, true and measured, and force against its target, over time."""
    figure = new_figure(10.0, 7.6)
    wide, narrow, force = figure.subplots(3, 1, sharex=True, height_ratios=(1, 1, 1.15))
    statuses = run.statuses
    time = run.seconds(statuses.stamp_ns)
    tracking, settled = settled_cycles(statuses)
    measured = np.where(tracking, -1e3 * _left(run, scene, real) * statuses.lateral_error, np.nan)
    true = np.where(real.tracking, 1e3 * real.lateral, np.nan)
    for axes in (wide, narrow):
        axes.plot(time, measured, color=ORANGE, linewidth=0.7, label='measured by touch')
        axes.plot(real.time, true, color=BLUE, linewidth=1.5, label='true')
    late = 1e3 * np.abs(real.lateral[real.settled])
    if late.size:
        seen = np.abs(measured[settled & np.isfinite(measured)])
        bound = 1.3 * max(late.max(), np.percentile(seen, 99.5) if seen.size else 0.0, 0.005)
        narrow.set_ylim(-bound, bound)
    label(wide, '', 'lateral [mm]', "Pad's centre left of the edge")
    label(narrow, '', 'lateral [mm]', 'The same, enlarged to what remains after settling')
    wide.legend(loc='center right', fontsize=9.5, frameon=False)
    _force(force, run, summary, real)
    for axes in (wide, narrow, force):
        _shade(axes, run, time, named=axes is wide)
        if settled.any():
            axes.axvline(time[np.flatnonzero(settled)[0]], color=GREY, linewidth=1.0,
                         linestyle=':')
    active = np.flatnonzero(statuses.state != State.IDLE)
    if active.size:
        wide.set_xlim(time[active[0]], time[active[-1]])
    figure.align_ylabels()
    return figure


def _left(run, scene, real):
    """+1 if the sensor's x points to the left of the edge, -1 if to the right."""
    along = np.einsum('ij,ij->i', run.poses.matrix[:, :3, 1], scene.edge.tangent_at(real.along))
    return 1.0 if along[real.tracking].sum() >= 0.0 else -1.0


def _force(axes, run, summary, real):
    axes.plot(run.seconds(run.contacts.stamp_ns),
              np.where(run.contacts.force_valid, run.contacts.normal_force, np.nan), color=ORANGE,
              linewidth=0.7)
    axes.plot(real.time, real.force, color=BLUE, linewidth=1.5)
    target = summary['force_target']
    label(axes, 'time [s]', 'normal force [N]', 'Force on the pad')
    if np.isfinite(target):
        axes.axhline(target, color=INK, linewidth=1.0, linestyle=(0, (6, 4)))
        axes.annotate(f'target {target:g} N', (0.995, target), (0, 5), fontsize=9.5,
                      xycoords=('axes fraction', 'data'), textcoords='offset points',
                      ha='right', va='bottom', color=INK)
        largest = np.nanmax(real.force, initial=target)
        axes.set_ylim(-0.04 * target, 1.2 * max(target, largest))


def _shade(axes, run, time, named):
    """Shade the states of the servo and name those that last."""
    state = run.statuses.state
    if not len(state):
        return
    starts = np.flatnonzero(np.diff(state, prepend=-1))
    active = time[state != State.IDLE]
    whole = np.ptp(active) if active.size else np.inf
    for start, end in pairwise([*starts, len(state) - 1]):
        begun, ended = time[start], time[end]
        colour, name = _SHADES.get(state[start], (None, ''))
        if colour:
            axes.axvspan(begun, ended, color=colour, linewidth=0, zorder=0)
        share = (ended - begun) / whole
        held = state[start] == State.HOLD  # named however short
        if named and name and (share > 0.025 or held):
            text = f'{name}, {1e3 * (ended - begun):.0f} ms' if held else name
            axes.annotate(text, (0.5 * (begun + ended), 0.96), fontsize=9.5,
                          xycoords=('data', 'axes fraction'), ha='center', va='top',
                          rotation=90 if share < 0.1 else 0, color=GREY)


def pictures(run: RunData) -> Figure:
    """Tactile pictures of approach, first contact, steady tracking and the end."""
    figure, images = new_figure(10.0, 3.0), run.images
    chosen = [(f'{name}, {run.seconds(images.stamp_ns[index]):.2f} s', index)
              for name, index in _moments(run)]
    panels = style.tactels(figure, images, chosen, 'The recording has no pictures of the run.')
    for axes, (_, index) in zip(panels, chosen, strict=True):
        _estimate(axes, run, index)
    return figure


def _moments(run):
    """Return names and indices of the pictures to show."""
    statuses, stamps = run.statuses, run.images.stamp_ns
    tracking, settled = (np.flatnonzero(mask) for mask in settled_cycles(statuses))
    if not len(stamps):
        return []
    approach = np.flatnonzero(statuses.state == State.APPROACH)
    moments = (('approach', approach, approach.size // 2), ('first contact', tracking, 0),
               ('steady', settled, settled.size // 2), ('end', tracking, -1))
    return [(name, min(int(np.searchsorted(stamps, statuses.stamp_ns[cycles[place]])),
                       len(stamps) - 1)) for name, cycles, place in moments if cycles.size]


def _estimate(axes, run, index):
    """Draw the estimated edge, or say that there is none."""
    contacts, array = run.contacts, run.images.array
    match = np.flatnonzero(contacts.stamp_ns == run.images.stamp_ns[index])
    x, y = 1e3 * array.half_width_x, 1e3 * array.half_width_y
    if match.size and contacts.valid[match[0]] and np.isfinite(contacts.yaw[match[0]]):
        at_x, at_y, yaw = (values[match[0]] for values in (
            1e3 * contacts.x, 1e3 * contacts.y, contacts.yaw))
        reach = 2.0 * np.hypot(x, y) * np.array([-1.0, 1.0])
        axes.plot(at_x - reach * np.sin(yaw), at_y + reach * np.cos(yaw),
                  color=style.ESTIMATE_COLOUR, linewidth=2.0)
        angle = round(np.degrees(yaw), 1) + 0.0  # no minus zero
        offset = at_x * np.cos(yaw) + at_y * np.sin(yaw)
        text = f'{offset:+.2f} mm from the centre, yaw = {angle:+.1f}\u00b0'
    elif match.size and contacts.type[match[0]] == ContactType.OTHER:
        style.mark_centre(axes, contacts.centre_of_pressure[match[0]])
        text = 'no straight line'
    else:
        text = 'no valid contact'
    axes.set_xlim(-x, x)
    axes.set_ylim(-y, y)
    axes.text(0.5, 0.03, text, transform=axes.transAxes, ha='center', va='bottom', fontsize=9,
              color=INK, bbox={'facecolor': 'white', 'edgecolor': 'none', 'alpha': 0.85,
                               'pad': 2.0})


def latency(run: RunData, summary: Mapping[str, Any]) -> Figure:
    """Histogram of the time from a picture's last byte to the command that used it."""
    figure = new_figure(7.5, 3.4)
    axes = figure.subplots()
    _, values = latencies(run)
    label(axes, 'last byte to command [ms]', 'pictures')
    if not len(values):
        note(axes, 0.3, 0.5, 'No picture was used.')
        return figure
    values = 1e3 * values
    period = 1e3 / summary['sensor_rate'] if summary['sensor_rate'] > 0 else np.nan
    right = 1.1 * np.nanmax([period, np.percentile(values, 99.8)])
    left = min(0.0, values.min())
    axes.hist(np.clip(values, left, right), bins=np.linspace(left, right, 80), color=BLUE,
              alpha=0.85)
    axes.set_xlim(left, right)
    top = axes.get_ylim()[1]
    axes.set_ylim(0.0, 1.25 * top)
    median, most = 1e3 * summary['latency_p50'], 1e3 * summary['latency_p99']
    lines = ((median, f'median {median:.2f} ms', INK), (most, f'99 %: {most:.2f} ms', ORANGE),
             (period, f'one picture, {period:.1f} ms', GREY))
    for level, (x, text, colour) in enumerate(lines):
        if np.isfinite(x):
            axes.axvline(x, color=colour, linewidth=1.5, linestyle='-' if level < 2 else '--')
            leftwards = x > 0.6 * right
            axes.annotate(text, (x, (1.18 - 0.12 * level) * top), (-5 if leftwards else 5, 0),
                          textcoords='offset points', fontsize=9.5, color=colour,
                          ha='right' if leftwards else 'left', va='center')
    return figure
