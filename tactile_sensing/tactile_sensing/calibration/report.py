"""Picture of a calibration: noise, gains, and what presses leave before and after."""

from pathlib import Path

import numpy as np

from tactile_sensing.calibration.procedure import Outcome
from tactile_sensing.calibration.skin_fit import fit_skin
from tactile_sensing.types.skin import Skin


def draw_report(outcome: Outcome, ball_radius: float, path: str | Path) -> None:
    """Draw what was found, with matplotlib, into a picture file."""
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot

    calibration = outcome.calibration
    figure, axes = pyplot.subplots(2, 3, figsize=(12, 7.5), layout='constrained')
    _map(figure, axes[0, 0], calibration.noise, 'noise of every tactel [counts]')
    relative = calibration.gain / calibration.gain[calibration.live].mean()
    _map(figure, axes[0, 1], np.where(calibration.live, relative, np.nan),
         'gain of every tactel, relative')
    if outcome.skin is None or outcome.presses is None:
        for axis in (axes[0, 2], *axes[1]):
            axis.axis('off')
        axes[0, 2].text(0.0, 0.5, 'no presses of a ball: skin and gains are assumed')
    else:
        _presses(figure, axes, outcome, ball_radius)
    figure.suptitle(f'{calibration.array.rows} x {calibration.array.columns} tactels, depth '
                    f'{1e3 * calibration.depth:.2f} mm, skin '
                    + (f'{1e3 * calibration.thickness:.2f} mm thick' if calibration.thickness
                       else 'without a backing near') + f', unit {calibration.unit}')
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def _presses(figure, axes, outcome, ball_radius):
    presses, after = outcome.presses, outcome.skin
    area = outcome.calibration.tactel == 'area'
    assumed = Skin(min(presses.array.pitch_x, presses.array.pitch_y))
    before = fit_skin(presses, ball_radius, area=area, known=assumed)
    relative = outcome.gains.gain if outcome.gains is not None else 1.0
    strongest = int(np.nanargmax(np.nanmax(presses.values, axis=(1, 2))))
    rest = (presses.values[strongest] - before.models[strongest],
            presses.values[strongest] * relative - after.models[strongest])
    limit = float(np.nanmax(np.abs(rest[0])))
    _map(figure, axes[1, 0], presses.values[strongest],
         f'frame {presses.number[strongest]} [counts]')
    for axis, left, title in zip(axes[1, 1:], rest, (
            'left before: half-space, depth one pitch', 'left after'), strict=True):
        _map(figure, axis, left, f'{title} [counts]', (-limit, limit))
    axis = axes[0, 2]
    for values, fit, label in ((presses.values, before, 'before'),
                               (presses.values * relative, after, 'after')):
        left = np.sqrt(np.nanmean((values - fit.models)**2, axis=(1, 2)))
        axis.plot(100.0 * left / np.nanmax(fit.models, axis=(1, 2)), 'o', label=label)
    axis.set(title='left of every press', ylabel='RMS over the peak [%]', xlabel='press',
             ylim=(0.0, None))
    axis.legend()


def _map(figure, axis, values, title, limits=(None, None)):
    picture = axis.imshow(values, origin='lower', vmin=limits[0], vmax=limits[1],
                          cmap='RdBu_r' if limits[0] is not None else 'viridis')
    axis.set_title(title, fontsize=10)
    figure.colorbar(picture, ax=axis, shrink=0.8)
