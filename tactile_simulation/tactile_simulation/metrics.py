"""What a simulated run achieved, measured against the truth of its scene."""

import math

import numpy as np

from tactile_servo.track_statistics import SETTLING_LENGTH
from tactile_servo.types import State

NAN = float('nan')
SPACING = 0.25e-3  # m between the places at which outlines are compared


def summarise(simulation, goal, status, *, name, tracker, seed, elapsed=NAN):
    """
    Summary of a run, with the keys and units of every command of this package set.

    Parameters
    ----------
    simulation : Simulation
        After its run.
    goal : EdgeGoal
    status : Status
        The last one.
    name, tracker : str
        Of the scene and of the controller.
    seed : int
    elapsed : float
        Real time that the run took [s].

    Returns
    -------
    dict
    """
    truth = simulation.truth()
    settled = truth[:, 3] >= SETTLING_LENGTH
    lateral, force = np.abs(truth[settled, 1]), truth[settled, 2]
    first = simulation.log[0].time
    duration = simulation.log[-1].time - first
    result = simulation.servo.result()
    error, area = contour_errors(result.contour, simulation.scene.edge)
    costs = np.array(simulation.cycle_costs or [NAN])
    return {
        'ok': bool(simulation.servo.success), 'state': status.state.name.lower(),
        'reason': status.reason.text, 'reason_code': status.reason.code.name.lower(),
        'scene': name, 'controller': tracker, 'seed': seed,
        'speed': goal.speed, 'tracked_length': status.progress,
        'lateral_rms': _rms(lateral), 'lateral_max': _largest(lateral),
        'lateral_steady': _rms(lateral[len(lateral) // 2:]),
        'lateral_transient_max': _largest(np.abs(truth[~settled, 1])),
        'force_target': goal.force, 'force_rms_error': _rms(force - goal.force),
        'force_max': max(cycle.force for cycle in simulation.log),
        'closed': result.closed, 'contour_max_error': error, 'contour_area_error': area,
        'duration': duration,
        'real_time_factor': duration / elapsed, 'sensor_rate': simulation.sensor_rate,
        'control_rate': simulation.control_rate, 'latency_p50': simulation.latency,
        'latency_p99': simulation.latency,
        'cpu_per_cycle': float(np.median(costs)),
        'cpu_per_picture': float(np.median(simulation.picture_costs or [NAN])),
        'states': state_history(simulation)}


def state_history(simulation):
    """Every state that was entered: time [s], state and reason."""
    history, last = [], None
    for cycle in simulation.log:
        if cycle.status.state != last:
            last = cycle.status.state
            history.append({'time': cycle.time, 'state': State(last).name.lower(),
                            'reason': cycle.status.reason.text,
                            'reason_code': cycle.status.reason.code.name.lower()})
    return history


def contour_errors(contour, edge):
    """
    Compare a rebuilt contour with the true edge, seen from above.

    Parameters
    ----------
    contour : ndarray, shape (N, 3), or None
        Base frame [m].
    edge : EdgePath

    Returns
    -------
    largest : float
        Largest distance of either from the other [m]; of an open edge, of the contour from
        the edge. NaN without a contour.
    area : float
        Relative error of the area; NaN of an open edge.
    """
    if contour is None or len(contour) < 2:
        return NAN, NAN
    if edge.closed:
        contour = np.vstack([contour, contour[:1]])
    contour = contour[np.concatenate([[True], (np.diff(contour, axis=0) != 0.0).any(axis=1)])]
    lateral, _ = edge.nearest(_resampled(contour))
    largest = float(np.abs(lateral).max())
    if not edge.closed:
        return largest, NAN
    lateral, _ = type(edge)(contour).nearest(_resampled(edge.points))
    largest = max(largest, float(np.abs(lateral).max()))
    return largest, area_of(contour) / area_of(edge.points) - 1.0


def area_of(points):
    """Area of a closed polyline (N, >= 2) seen from above [m^2]."""
    x, y = points[:, 0] - points[0, 0], points[:, 1] - points[0, 1]
    return abs(0.5 * float(x[:-1] @ y[1:] - x[1:] @ y[:-1]))


def _resampled(points):
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    s = np.union1d(np.linspace(0.0, along[-1], math.ceil(along[-1] / SPACING) + 1), along)
    return np.column_stack([np.interp(s, along, axis) for axis in points.T])


def _rms(values):
    return float(np.sqrt(np.mean(values**2))) if len(values) else NAN


def _largest(values):
    return float(values.max()) if len(values) else NAN
