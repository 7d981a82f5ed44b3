"""A recorded run over a surface in numbers: how well it was followed, and what it was."""
from typing import Any

import numpy as np

from edge_tracking.recording.run import RunData
from edge_tracking.recording.summary import of_servo, settled_cycles
from tactile_servo.reasons import ReasonCode
from tactile_shape.types.patch import Kind
from tactile_simulation.metrics import NAN, percentile
from tactile_simulation.scene_surface import SurfaceScene
from tactile_simulation.scenes import renderer_of
from tactile_simulation.surface_metrics import measure_surface, place_on_pad, SurfaceTruth


def surface_truth(run: RunData, scene: SurfaceScene) -> SurfaceTruth:
    """Compare the recorded poses of the probe with the scene; time as of `run.seconds`."""
    poses, statuses, renderer = run.poses, run.statuses, renderer_of(scene)
    # The cycle that was the newest when the pose was taken tells the state.
    newest = np.searchsorted(statuses.stamp_ns, poses.stamp_ns, side='right') - 1
    progress, tracking, settled = (
        np.append(values, values.dtype.type(0))[newest]  # -1, before the first cycle: the 0
        for values in (statuses.progress, *settled_cycles(statuses)))
    force = np.array([renderer.force(pose) for pose in poses.matrix])
    places = np.array([place_on_pad(scene, pose) if on else (NAN, NAN)
                       for pose, on in zip(poses.matrix, tracking, strict=True)])
    return SurfaceTruth(run.seconds(poses.stamp_ns), places.reshape(-1, 2), force, progress,
                        tracking, settled)


def told_shape(patches: list) -> dict[str, Any]:
    """
    Kind of surface that most patches are, its radius [m], and whether both curvatures were seen.

    A straight way over a sphere is as one round a cylinder: the curvature across it is not seen.
    """
    kinds = [patch.kind for patch in patches if patch.valid]
    if not kinds:
        return {'surface_kind': Kind.NONE.name.lower(), 'surface_radius': NAN,
                'surface_seen_across': False}
    kind = max(set(kinds), key=kinds.count)
    of_kind = [patch for patch in patches if patch.kind == kind]
    curvature = percentile([patch.curvature[0] for patch in of_kind if patch.seen[0]])
    round_ = kind in (Kind.CYLINDER, Kind.SPHERE) and curvature != 0.0
    return {'surface_kind': kind.name.lower(),
            'surface_radius': 1.0 / curvature if round_ else NAN,
            'surface_seen_across': bool(np.mean([patch.seen.all() for patch in of_kind]) > 0.5)}


def summarise_surface_run(run: RunData, scene: SurfaceScene, truth: SurfaceTruth, *,
                          success: bool, reason: str = '', reason_code: int = ReasonCode.NONE,
                          speed: float, force: float, seed: int | None = None
                          ) -> dict[str, Any]:
    """
    Return the summary of a run over the surface of a scene, SI units, NaN = unknown.

    Forces, places on the pad and the distances of the contacts are those of the scene at the
    recorded poses; `ok` only if the action succeeded and nothing fragile broke.
    """
    measured = measure_surface(scene, truth, run.touches.position, force,
                               run.joint_acceleration)
    summary = {
        **of_servo(run, scene.name, reason, reason_code, speed, seed),
        **measured, **told_shape(run.patches)}
    summary['ok'] = success and not measured['broken']
    if measured['broken']:
        summary['reason'] += '; but what was touched has broken'
    return summary
