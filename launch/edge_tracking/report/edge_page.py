"""What a report says of a run along the edge of a scene."""
from collections.abc import Mapping
import math
from typing import Any

import numpy as np

from edge_tracking.recording.run import RunData
from edge_tracking.recording.summary import rebuilt_outline
from edge_tracking.report import figures, plans
from edge_tracking.report.html import listed, of_this_run, Section
from tactile_simulation.edge_world import EdgeScene, EdgeTruth

LEAST = 6e-3  # m that contacts of a surface spread over


def sections(run: RunData, summary: Mapping[str, Any], scene: EdgeScene, real: EdgeTruth
             ) -> list[Section]:
    """Parts of the page but for those of every run."""
    parts = [
        Section(
            'Path of the pad', plans.trajectory(run, scene, real),
            'Centre of the pad over the true edge, with the outline of the pad at first contact '
            f'and at the end. The run begins '
            f'{1e3 * abs(scene.start.offset):.1f} mm beside the edge; the detail shows how touch '
            "takes that away. Positions are from the robot's forward kinematics, errors against "
            'the scene, which only the mock sensor knows.'
            + of_this_run(summary, 'tracked_length', 'edge_length', 'duration')),
        Section(
            'Lateral error and force', figures.errors(run, summary, scene, real),
            'True: from pose and scene. Measured: what the contact estimate gave the servo. '
            'The statistics count from the dotted line, 10 mm after first contact; those of the '
            'force only while the edge crosses the whole pad.' + of_this_run(
                summary, 'lateral_rms', 'lateral_max', 'force_rms_error', 'force_max')),
        Section(
            'Tactile pictures', figures.pictures(run),
            'Pressure over the pad, compression positive, with the estimated edge drawn in where '
            'the estimate is a valid line; the cross is the centre of pressure where what touches '
            'is no straight line, as on a curve or at the end of the edge.'
            + of_this_run(summary, 'sensor_rate', 'force_target'))]
    found = rebuilt_outline(run)
    if found is not None:
        parts.insert(2, Section(
            'Rebuilt outline', plans.outline(run, scene, found),
            'Lines, arcs and corners, as few as the contacts along the edge allow. Each contact '
            'is a point of the fitted line or, on a curve and at a corner, of the ridge of the '
            'picture, put into the base by the pose of the robot. '
            'This run: ' + ', '.join(filter(None, (
                f'{len(found.sides)} sides', f'{len(found.corners)} corners',
                listed(summary, 'contour_max_error', 'contour_area_error')))) + '.'))
    # Of an edge that was touched for the first time a few contacts may look like a surface.
    if len(run.patches) and np.ptp([patch.origin for patch in run.patches], axis=0).max() > LEAST:
        parts.append(Section(
            'Surface', plans.surface(run),
            'Where a surface was touched: patches of second order, coloured by the least one '
            'that explains the contacts, and the way of the contact. '
            f'This run: {len(run.patches)} patches.', 'narrow'))
    return parts


def lead(summary: Mapping[str, Any]) -> str:
    """Sentences about how well the edge was followed."""
    text = ''
    if math.isfinite(summary['lateral_rms']):
        text = (f" The pad's centre stayed within {1e3 * summary['lateral_max']:.3f} mm of the "
                f"true edge, {1e3 * summary['lateral_rms']:.3f} mm RMS, over "
                f"{1e3 * summary['tracked_length']:.0f} mm at "
                f"{1e3 * summary['speed_mean']:.0f} mm/s on average.")
    if not summary['approach_recorded']:
        text += ' No image was recorded before first contact: the recording began late.'
    return text
