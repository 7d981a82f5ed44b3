"""What happened in a run over time: errors, force, latency."""
from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure
from matplotlib.patches import Patch
import numpy as np

from edge_tracking.recording.frames_summary import force_series, force_unit
from edge_tracking.recording.run import RunData
from edge_tracking.recording.summary import latencies, settled_cycles
from tactile_sensing.types.contact import ContactType
from tactile_servo.types import State
from tactile_simulation.plot import BLUE, GREY, INK, label, new_figure, note, ORANGE, show_settled
from tactile_simulation.world import Scene

_SHADES = {
    State.APPROACH: '#eaf0f8', State.CORNER: '#fff4d6', State.SEARCH: '#fdebd3',
    State.RETREAT: '#dfe7ef', State.HOLD: '#fadcd9'}


def over_time(run: RunData, summary: Mapping[str, Any], scene: Scene | None = None,
              real: Any = None) -> Figure:
    """Place of what is followed on the pad, and force, over time; true where there is a truth."""
    figure = new_figure(10.0, 7.6)
    wide, narrow, force = panels = figure.subplots(3, 1, sharex=True, height_ratios=(1, 1, 1.15))
    statuses, active = run.statuses, run.statuses.state != State.IDLE
    time = run.seconds(statuses.stamp_ns)
    tracking, settled = settled_cycles(statuses)
    measured = np.column_stack([statuses.lateral_error, statuses.longitudinal_error])
    measured = np.where(tracking[:, None], 1e3 * measured, np.nan)
    known, judged = None, measured[settled]
    if real is not None:
        known = 1e3 * place_on_pad(run, scene, real)
        judged = known[real.settled]
    for axis, (name, thin, thick) in enumerate(
            (('x', ORANGE, BLUE), ('y', '#c9a227', '#6aa3d8'))):
        for axes in (wide, narrow):
            if np.isfinite(measured[:, axis]).any():
                axes.plot(time, measured[:, axis], color=thin, linewidth=0.7,
                          label=f'{name} by touch')
            if known is not None and np.isfinite(known[:, axis]).any():
                axes.plot(real.time, known[:, axis], color=thick, linewidth=1.5,
                          label=f'{name}, true')
    show_settled(narrow, judged, 5e-3)
    label(wide, '', 'off centre [mm]', "What is followed, from the pad's centre")
    label(narrow, '', 'off centre [mm]', 'The same, enlarged to what remains after settling')
    _force(force, run, summary, real)
    lines, names = wide.get_legend_handles_labels()
    for state in sorted({*statuses.state[active]} & _SHADES.keys()):
        lines.append(Patch(color=_SHADES[state]))
        names.append(State(state).name.lower())
        for axes in panels:
            axes.fill_between(
                time, 0.0, 1.0, where=statuses.state == state, linewidth=0.0, zorder=0,
                color=_SHADES[state], transform=axes.get_xaxis_transform())
    if lines:
        figure.legend(lines, names, loc='outside lower center', ncols=8, fontsize=9.5,
                      frameon=False)
    for axes in panels if settled.any() else ():
        axes.axvline(time[np.argmax(settled)], color=GREY, linewidth=1.0, linestyle=':')
    if active.any():
        wide.set_xlim(*time[active][[0, -1]])
    figure.align_ylabels()
    return figure


def place_on_pad(run: RunData, scene: Any, real: Any) -> np.ndarray:
    """True place of what is followed on the pad, along x and y (N, 2) [m], NaN where unknown."""
    if scene.action == 'track_surface':
        return real.place
    along = np.einsum('ij,ij->i', run.poses.matrix[:, :3, 1], scene.edge.tangent_at(real.along))
    left = 1.0 if along[real.tracking].sum() >= 0.0 else -1.0  # where the sensor's x points to
    lateral = np.where(real.tracking, -left * real.lateral, np.nan)
    return np.column_stack([lateral, np.full_like(lateral, np.nan)])


def _force(axes, run, summary, real):
    series = force_series(run)
    scale, unit = force_unit(series.unit)
    stamps, felt, contacts = series.stamp_ns, series.force, run.contacts
    touching = contacts.type != ContactType.NONE
    if 2 * contacts.force_valid[touching].sum() > touching.sum():
        stamps = contacts.stamp_ns
        felt = np.where(contacts.force_valid, contacts.normal_force, np.nan)
    axes.plot(run.seconds(stamps), scale * felt, color=ORANGE, linewidth=0.7)
    if real is not None:
        axes.plot(real.time, real.force, color=BLUE, linewidth=1.5)
    target = summary['force_target']
    label(axes, 'time [s]', f'normal force [{unit}]', 'Force on the pad')
    if np.isfinite(target) and unit == 'N':
        axes.axhline(target, color=INK, linewidth=1.0, linestyle=(0, (6, 4)))
        axes.set_title(f'Force on the pad; dashed: the target, {target:g} N', fontsize=11,
                       loc='left', color=INK)
        largest = np.nanmax(felt if real is None else real.force, initial=target)
        axes.set_ylim(-0.04 * target, 1.2 * max(target, largest))


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
