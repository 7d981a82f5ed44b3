"""What a report says of a run over the surface of a scene."""
from collections.abc import Mapping
import math
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from edge_tracking.recording.run import RunData
from edge_tracking.report import plans
from edge_tracking.report.html import of_this_run, Section
from tactile_servo.types import State
from tactile_simulation.plot import BLUE, INK, label, new_figure, note, ORANGE, show_contacts
from tactile_simulation.surface_world import SurfaceScene, SurfaceTruth


def sections(run: RunData, summary: Mapping[str, Any], scene: SurfaceScene, real: SurfaceTruth
             ) -> list[Section]:
    """Parts of the page but for those of every run."""
    parts = [
        Section('The surface that was felt', felt(run, scene, real),
                'Contacts, coloured by their distance from the true surface, which only the mock '
                'sensor knows; and the curvature along the way by the shape estimator, live.'
                + of_this_run(summary, 'tracked_length', 'surface_rms', 'surface_max')),
        Section('Force and place of the contact', course(run, summary, real),
                'True: from pose and scene. Measured: by the image.'
                + of_this_run(summary, 'force_target', 'force_rms_error', 'force_max'))]
    if len(run.patches):
        parts.insert(1, Section(
            'Patches', plans.surface(run),
            'Patches of second order, coloured by the least one that explains the contacts, and '
            'the way of the contact; surface.ply holds them. '
            f'This run: {len(run.patches)} patches.', 'narrow'))
    return parts


def lead(summary: Mapping[str, Any]) -> str:
    """Sentences about how well the surface was followed, and what it is."""
    text = ''
    if math.isfinite(summary['surface_rms']):
        text = (f' Over {1e3 * summary["tracked_length"]:.0f} mm the contacts lie within '
                f'{1e3 * summary["surface_max"]:.3f} mm of the true surface, '
                f'{1e3 * summary["surface_rms"]:.3f} mm RMS.')
    text += f' The least surface that explains them: {summary["surface_kind"]}'
    if math.isfinite(summary['surface_radius']):
        text += f' of {1e3 * summary["surface_radius"]:.2f} mm radius'
    if summary['surface_kind'] != 'none' and not summary['surface_seen_across']:
        text += ' (how it bends across the way was not seen)'
    return f'{text}.'


def felt(run: RunData, scene: SurfaceScene, real: SurfaceTruth) -> Figure:
    """Contacts from above and from the side, and curvatures along the way."""
    figure = new_figure(10.0, 7.0)
    (above, side), (bend, unused) = figure.subplots(2, 2)
    unused.remove()
    show_contacts(figure, above, side, run.touches.position, scene)
    way = 1e3 * np.cumsum([0.0, *(np.linalg.norm(b.origin - a.origin) for a, b in zip(
        run.patches, run.patches[1:], strict=False))])[:len(run.patches)]
    for axis, colour in enumerate((BLUE, ORANGE)):
        seen = [patch.curvature[axis] if patch.seen[axis] else np.nan for patch in run.patches]
        bend.plot(way, seen, '.', color=colour, markersize=2.5, label=('first', 'second')[axis])
    label(bend, 'way [mm]', 'principal curvatures [1/m]', 'Curvature, where the path could see it')
    bend.legend(fontsize=9.5, frameon=False)
    return figure


def course(run: RunData, summary: Mapping[str, Any], real: SurfaceTruth) -> Figure:
    """Force and place of the contact on the pad over time."""
    figure = new_figure(10.0, 5.6)
    force, place = figure.subplots(2, 1, sharex=True)
    active = run.statuses.state != State.IDLE
    force.plot(run.seconds(run.contacts.stamp_ns), run.contacts.m0, color=ORANGE, linewidth=0.7,
               label='measured')
    force.plot(real.time, real.force, color=BLUE, linewidth=1.3, label='true')
    force.axhline(summary['force_target'], color=INK, linewidth=1.0, linestyle=(0, (6, 4)))
    label(force, '', 'normal force [N]', 'Force on the probe')
    force.legend(fontsize=9.5, frameon=False)
    for axis, colour in enumerate((BLUE, ORANGE)):
        place.plot(real.time, 1e3 * real.place[:, axis], color=colour, linewidth=1.3,
                   label='xy'[axis])
    label(place, 'time [s]', "from the pad's centre [mm]", 'True place of the contact on the pad')
    place.legend(fontsize=9.5, frameon=False)
    if active.any():
        times = run.seconds(run.statuses.stamp_ns)[active]
        place.set_xlim(times[0], times[-1])
    else:
        note(place, 0.3, 0.5, 'The servo did not run.')
    return figure
