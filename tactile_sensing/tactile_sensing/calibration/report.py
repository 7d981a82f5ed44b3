"""Draw the report of a calibration: noise, gains, and residuals before and after."""

from pathlib import Path
from typing import Any

import numpy as np

from tactile_sensing.calibration.likelihood import KIND, skin_of, step_of
from tactile_sensing.calibration.presses import Presses
from tactile_sensing.calibration.procedure import Outcome
from tactile_sensing.calibration.skin_fit import Fit, fit_presses
from tactile_sensing.calibration.verdict import verdict
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.types.skin import Skin


def draw_report(outcome: Outcome, ball_radius: float, path: str | Path) -> None:
    """Draw the report of a calibration with matplotlib into a picture file."""
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot

    calibration = outcome.calibration
    figure, axes = pyplot.subplots(2, 4, figsize=(15, 7.5), layout='constrained')
    _map(figure, axes[0, 0], calibration.noise, 'noise of every tactel [counts]')
    relative = calibration.gain / calibration.gain[calibration.live].mean()
    _map(figure, axes[0, 1], np.where(calibration.live, relative, np.nan),
         'gain of every tactel, relative')
    if outcome.skin is None or outcome.presses is None:
        for axis in (*axes[0, 2:], *axes[1]):
            axis.axis('off')
        axes[0, 2].text(0.0, 0.5, 'no presses of a ball: skin and gains are assumed')
    else:
        _map(figure, axes[0, 2], np.where(calibration.live, 100.0 * outcome.skin.gain_std, np.nan),
             '+- of every gain [%]')
        _presses(figure, axes, outcome, outcome.presses, outcome.skin, ball_radius)
    figure.suptitle(f'{calibration.array.rows} x {calibration.array.columns} tactels: '
                    + verdict(calibration, outcome.skin))
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def _presses(figure: Any, axes: np.ndarray, outcome: Outcome, presses: Presses, after: Fit,
             ball_radius: float) -> None:
    assumed = Skin(min(presses.array.pitch_x, presses.array.pitch_y))
    before = fit_presses(presses, ball_radius, area=outcome.calibration.tactel == 'area',
                         known=assumed)
    strongest = int(np.nanargmax(np.nanmax(presses.values, axis=(1, 2))))
    rest = [presses.values[strongest] - fit.models[strongest] for fit in (before, after)]
    limit = float(np.nanmax(np.abs(rest[0])))
    _map(figure, axes[1, 0], presses.values[strongest],
         f'frame {presses.number[strongest]} [counts]')
    for axis, left, title in zip(axes[1, 1:], rest, (
            'left before: depth one pitch', 'left after'), strict=False):
        _map(figure, axis, left, f'{title} [counts]', (-limit, limit))
    for fit, label in ((before, 'before'), (after, 'after')):
        left = np.sqrt(np.nanmean((presses.values - fit.models)**2, axis=(1, 2)))
        axes[0, 3].plot(100.0 * left / np.nanmax(fit.models, axis=(1, 2)), 'o', label=label)
    axes[0, 3].set(title='left of every press', ylabel='RMS over the peak [%]', xlabel='press',
                   ylim=(0.0, None))
    axes[0, 3].legend()
    _profile(axes[1, 3], after)


def _profile(axis: Any, fit: Fit) -> None:
    """Draw the pressure of a point load in the skin, with its standard deviation."""
    x = np.linspace(0.0, 4.0 * fit.skin.depth, 60)

    def pressure(kind: np.ndarray) -> np.ndarray:
        values = SkinPressure(skin_of(kind)).point(x, 0.0 * x, 0.0, 0.0, 1.0)
        return values / values[0]
    here, steps = pressure(fit.kind), [step_of(fit.kind, k) for k in range(3)]
    slopes = np.stack([(pressure(fit.kind + step * np.eye(KIND)[k]) - here) / step
                       for k, step in enumerate(steps)], -1)
    std = np.sqrt(np.einsum('xi,ij,xj->x', slopes, fit.covariance[:3, :3], slopes))
    axis.plot(1e3 * x, here)
    axis.fill_between(1e3 * x, here - std, here + std, alpha=0.4)
    axis.set(title='point load, +- standard deviation', xlabel='from it [mm]')


def _map(figure: Any, axis: Any, values: np.ndarray, title: str,
         limits: tuple = (None, None)) -> None:
    picture = axis.imshow(values, origin='lower', vmin=limits[0], vmax=limits[1],
                          cmap='RdBu_r' if limits[0] is not None else 'viridis')
    axis.set_title(title, fontsize=10)
    figure.colorbar(picture, ax=axis, shrink=0.8)
