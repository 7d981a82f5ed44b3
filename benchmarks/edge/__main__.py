"""
Edge tracking: speed, accuracy, stability and limits of both laws, in simulation.

Prints tables, and writes benchmarks/results/edge.json, pictures into docs/ and the tables into
docs/results_edge.md. Errors are distances of the pad's centre from the true edge. Every run is
seeded.
"""

from benchmarks.edge import runs
from benchmarks.harness import run

WHOLE = 0.17  # m of a hard scene's 180 mm that must be tracked
TRACKERS = ('resolved_rate', 'trace')
SPEEDS = (0.01, 0.03, 0.05, 0.1, 0.15, 0.2)
COURSES = ('straight', 'two_segments', 'curve', 'course')
GAINS = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0)  # of the theoretical limit
LATENCIES = (0.0, 0.005, 0.01, 0.02, 0.03, 0.04)
CORNERS = (15, 30, 45, 60, 75, 90, 105, 120, 135, 150)
RADII = (0.005, 0.0075, 0.01, 0.015, 0.02, 0.03, 0.06)
CORNER_SPEED = 0.05
FIGURES = {'Figure 5.5': ('straight', 0.03), 'Figure 5.6': ('two_segments', 0.026),
           'Figure 5.7': ('curve', 0.023), 'Figure 5.8': ('straight_3d', 0.03),
           'Figure 5.9': ('tape_case', 0.03)}
HARD = ('gap', 'step_down', 'step_up', 'wave', 'slip', 'noise', 'gain_spread', 'dead_tactels',
        'latency', 'stamps')


def speed_and_accuracy(seeds, speeds, progress):
    """Run chart (a): every course at every speed."""
    rows = []
    for course in COURSES:
        scene = runs.shipped(course)
        for tracker in TRACKERS:
            for speed in speeds:
                progress.step(f'{course}, {tracker}, {1e3 * speed:g} mm/s')
                summaries = [runs.follow(scene, tracker, speed, seed, timed=True)[1]
                             for seed in seeds]
                rows.append({'course': course, 'tracker': tracker, 'speed': speed,
                             **runs.worst(summaries)})
    return rows


def stability(gains, latencies, progress):
    """Run chart (b): gains and latencies."""
    rows = []
    plant = runs.shipped('straight').plant
    for latency in latencies:
        limit = runs.theoretical_gain(latency, plant.dead_time, plant.lag)
        for tracker in TRACKERS:
            progress.step(f'stability, {tracker}, {1e3 * latency:g} ms')
            for gain in gains:
                rows.append({'tracker': tracker, 'latency': latency, 'gain': gain * limit,
                             'limit': limit,
                             'stable': runs.is_stable(tracker, gain * limit, latency)})
    return rows


def corners_and_radii(corners, radii, seeds, progress):
    """Run chart (c): which corners and radii are held, cut or lost."""
    shapes = [('corner', degrees, [{'straight': 0.07}, {'turn': degrees}, {'straight': 0.07}])
              for degrees in corners]
    shapes += [('radius', radius, [
        {'straight': 0.06}, {'arc': {'radius': radius, 'angle': 90}}, {'straight': 0.06}])
        for radius in radii]
    rows = []
    for kind, size, path in shapes:
        scene = runs.path_scene(f'{kind} {size}', path)
        for tracker in TRACKERS:
            progress.step(f'{kind} {size:g}, {tracker}')
            summaries = [runs.follow(scene, tracker, CORNER_SPEED, seed, seconds=40.0)[1]
                         for seed in seeds]
            verdicts = [runs.corner_verdict(summary) for summary in summaries]
            rows.append({'kind': kind, 'size': size, 'tracker': tracker,
                         'verdict': max(verdicts, key=('held', 'cut', 'lost').index),
                         'reason': summaries[-1]['reason'], **runs.worst(summaries)})
    return rows


def hard_scenes(seeds, progress):
    """Run the scenes with other difficulties."""
    rows = []
    for name in HARD:
        scene = runs.shipped(name)
        for tracker in TRACKERS:
            progress.step(f'{name}, {tracker}')
            summaries = [runs.follow(scene, tracker, 0.03, seed)[1] for seed in seeds]
            length = min(summary['edge_length'] for summary in summaries)
            rows.append({'scene': name, 'tracker': tracker, 'length': length,
                         'survived': length >= WHOLE and all(s['ok'] for s in summaries),
                         'reason': summaries[-1]['reason'], **runs.worst(summaries)})
    return rows


def figures(progress):
    """Run chart (d): the thesis' Figures 5.5 to 5.9."""
    made = []
    for figure, (name, speed) in FIGURES.items():
        scene = runs.shipped(name)
        for tracker in TRACKERS:
            closed = scene.edge.closed
            if closed and tracker == 'resolved_rate':
                continue
            progress.step(f'{figure}, {tracker}')
            simulation, summary = runs.follow(scene, tracker, speed, 0, closed=closed)
            made.append({'figure': figure, 'scene': name, 'tracker': tracker, 'speed': speed,
                         '_edge': scene.edge.points.tolist(), **runs.way_of(simulation),
                         **{key: summary[key] for key in (
                             'ok', 'lateral_rms', 'lateral_max', 'contour_max_error',
                             'contour_area_error', 'force_rms_error')}})
    return made


def measure(arguments, progress):
    """Return all data of the tables and pictures as one dictionary."""
    quick = arguments.quick
    seeds = (0,) if quick else (0, 1)
    return {
        'seeds': list(seeds),
        'speed_and_accuracy': speed_and_accuracy(
            seeds, SPEEDS[1::2] if quick else SPEEDS, progress),
        'stability': stability(
            GAINS[1::2] if quick else GAINS, LATENCIES[::2] if quick else LATENCIES, progress),
        'corners': corners_and_radii(CORNERS[1::3] if quick else CORNERS,
                                     RADII[::3] if quick else RADII, seeds, progress),
        'hard_scenes': hard_scenes(seeds[:1], progress),
        'figures': figures(progress)}


if __name__ == '__main__':
    run('edge', __doc__, measure, lambda arguments: 62 if arguments.quick else 112)
