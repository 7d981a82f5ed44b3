"""Course and tape case with pads of other sizes and pitches; run manually, takes minutes."""

from dataclasses import replace

import numpy as np

from benchmarks.edge.runs import follow, shipped
from tactile_simulation.sensor import SceneSkin, Sensor

DEEP = 1.5  # depth in pitches (the larger pitch)
SPEEDS, SEEDS = (0.03, 0.05), range(3)
# Rows, columns, pitch of the columns and of the rows, depth [m]
PADS = [(8, 8, 2.5e-3, 2.5e-3), (16, 16, 1e-3, 1e-3), (16, 16, 4e-3, 4e-3),
        (28, 28, 1.27e-3, 1.27e-3), (12, 24, 1e-3, 1.5e-3)]


def scene_for(name, rows, columns, pitch_x, pitch_y):
    """Return an installed scene with a pad, its noise and range scaled to the peak of 5 N."""
    scene, depth = shipped(name), DEEP * max(pitch_x, pitch_y)
    share = (SceneSkin().depth * Sensor().array.size_y) / (depth * rows * pitch_y)
    sensor = Sensor(rows=rows, columns=columns, pitch_x=pitch_x, pitch_y=pitch_y,
                    noise_std=share * Sensor().noise_std,
                    pa_per_count=share * Sensor().pa_per_count)
    return replace(scene, skin=replace(scene.skin, depth=depth), sensor=sensor)


def main():
    """Print a row for each pad and scene: the worst of all speeds and seeds."""
    print('| pad | depth, mm | scene | done | lateral RMS, mm | largest, mm | largest / depth '
          '| force, N |')
    print('| --- | --- | --- | --- | --- | --- | --- | --- |')
    for rows, columns, pitch_x, pitch_y in PADS:
        for name in ('course', 'tape_case'):
            scene = scene_for(name, rows, columns, pitch_x, pitch_y)
            runs = [follow(scene, 'trace', speed, seed, closed=scene.edge.closed)[1]
                    for speed in SPEEDS for seed in SEEDS]
            rms, largest, force = (np.max([run[key] for run in runs]) for key in (
                'lateral_rms', 'lateral_max', 'force_max'))
            print(f'| {rows}×{columns}, {1e3 * pitch_x:g}×{1e3 * pitch_y:g} mm '
                  f'| {1e3 * scene.skin.depth:g} | {name} '
                  f'| {sum(run["ok"] for run in runs)}/{len(runs)} | {1e3 * rms:.3f} '
                  f'| {1e3 * largest:.2f} | {largest / scene.skin.depth:.3f} | {force:.1f} |',
                  flush=True)


if __name__ == '__main__':
    main()
