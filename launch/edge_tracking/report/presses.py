"""Figures of what pressed on a sensor: force, presses, centre of pressure."""

from matplotlib.figure import Figure
import numpy as np

from edge_tracking.recording.frames_summary import force_unit, ForceSeries, presses
from edge_tracking.recording.run import RunData
from edge_tracking.report import style
from tactile_simulation.plot import (
    BLUE,
    colour_bar,
    EDGE_COLOUR,
    GREY,
    label,
    new_figure,
    ORANGE,
)

SHOWN_PRESSES = 8


def _loaded(series):
    return series.force > 0.1 * np.nanmax(series.force, initial=0.0)


def force_over_time(series: ForceSeries) -> Figure:
    """Force, with the presses, and centre of pressure over time."""
    figure = new_figure(10.0, 5.6)
    force, centre = figure.subplots(2, 1, sharex=True)
    scale, unit = force_unit(series.unit)
    force.plot(series.time, scale * series.force, color=BLUE, linewidth=1.5)
    label(force, '', f'force [{unit}]', 'Force, with its presses')
    for number, (begin, peak, end) in enumerate(presses(series.force), 1):
        top = series.time[peak], scale * series.force[peak]
        force.axvspan(series.time[begin], series.time[min(end, len(series.time) - 1)],
                      color='#eaf0f8', zorder=0, linewidth=0)
        force.plot(*top, 'o', color=ORANGE, markersize=4.5)
        force.annotate(str(number), top, (0, 6), textcoords='offset points', ha='center',
                       fontsize=9.5, color=ORANGE)
    force.set_ylim(0.0, 1.15 * scale * np.nanmax(series.force, initial=1e-9))
    loaded = _loaded(series)
    for axis, (name, colour) in enumerate((('x', BLUE), ('y', ORANGE))):
        values = np.where(loaded, 1e3 * series.centre_of_pressure[:, axis], np.nan)
        centre.plot(series.time, values, color=colour, linewidth=1.5)
        if loaded.any():
            last = np.flatnonzero(loaded)[-1]
            centre.annotate(name, (series.time[last], values[last]), (8, 0), fontsize=11,
                            textcoords='offset points', color=colour, va='center')
    label(centre, 'time [s]', 'centre of pressure [mm]', 'Centre of pressure')
    if len(series.time) > 1:
        force.set_xlim(series.time[0], series.time[-1])
    return figure


def press_pictures(run: RunData, series: ForceSeries, limit: int) -> Figure:
    """Pictures at the peaks of presses, evenly chosen, with the centre of pressure."""
    images = run.images
    found = presses(series.force) if images.array is not None else []
    keep = np.unique(np.linspace(0, len(found) - 1, min(limit, len(found))).round().astype(int))
    peaks = [found[number].peak for number in keep]
    chosen = [(f'press {number + 1}, {series.time[peak]:.1f} s',
               int(np.argmin(np.abs(images.stamp_ns - series.stamp_ns[peak]))))
              for number, peak in zip(keep, peaks, strict=True)]
    figure = new_figure(10.0, 0.5 + 2.45 * max(-(-len(keep) // style.IN_A_ROW), 1))
    panels = style.tactels(figure, images, chosen, 'No presses were found.')
    for axes, peak in zip(panels, peaks, strict=True):
        style.mark_centre(axes, series.centre_of_pressure[peak])
    return figure


def centre_path(run: RunData, series: ForceSeries) -> Figure:
    """Path of the centre of pressure on the array, coloured by the force, and enlarged."""
    figure, array, loaded = new_figure(10.0, 4.4), run.images.array, _loaded(series)
    x, y = 1e3 * series.centre_of_pressure[loaded].T
    scale, unit = force_unit(series.unit)
    whole, near = panels = figure.subplots(1, 2)
    for axes in panels:
        axes.plot(x, y, color=EDGE_COLOUR, linewidth=0.8, zorder=1)
        points = axes.scatter(x, y, c=scale * series.force[loaded], cmap='magma_r', zorder=2,
                              s=8 if axes is whole else 26, vmin=0.0)
    label(whole, 'x [mm]', 'y [mm]', 'On the array')
    label(near, 'x [mm]', '', 'Enlarged')
    whole.set_aspect('equal')
    near.set_aspect('equal', adjustable='datalim')
    if array is not None:
        half_x, half_y = 1e3 * array.half_width_x, 1e3 * array.half_width_y
        whole.plot([-half_x, half_x, half_x, -half_x, -half_x],
                   [-half_y, -half_y, half_y, half_y, -half_y], color=GREY, linewidth=1.2)
    colour_bar(figure, points, panels, f'force [{unit}]', shrink=0.85, aspect=20)
    return figure


def centre_extent(series: ForceSeries) -> np.ndarray:
    """Range of the centre of pressure along x and y, where it is shown, `(2,)` [m]."""
    shown = series.centre_of_pressure[_loaded(series)]
    return np.ptp(shown, axis=0) if len(shown) else np.zeros(2)
