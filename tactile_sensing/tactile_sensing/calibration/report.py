"""Report on a calibration: its accuracy in words, reasons to doubt it, and a drawing."""

from pathlib import Path
from typing import Any

import numpy as np

from tactile_sensing.calibration.presses import Presses
from tactile_sensing.calibration.skin_fit import SkinFit
from tactile_sensing.devices.calibration import Calibration

MOST_DEAD = 0.1  # largest usual share of dead tactels
MOST_LEFT_OUT = 0.04  # largest usual share of the pressure that the model does not explain
USUAL_PATCH = 0.25, 0.75  # radius of a patch over that of the ball
MOST_PRESSURE = 10e6  # largest usual mean pressure under the ball [Pa]
MOST_UNCERTAIN = 0.1  # largest usual standard deviation of the depth over the depth
MOST_SPREAD = 0.3  # largest usual relative standard deviation of the gains
FEW_PRESSES = 8  # with fewer presses, their consistency cannot be judged


def doubts(fit: SkinFit | None, ball_radius: float, dead: float,
           force: np.ndarray | None = None) -> list[str]:
    """
    Return reasons not to trust a calibration: a wrong ball or pitch, a broken pad, few presses.

    `fit` is the fit of the presses (None: no presses), `ball_radius` is in m, `dead` is the share
    of dead tactels, and `force` those of the presses in N (None: unknown).
    """
    found, check = [], 'check --ball-radius and --pitch'
    if dead > MOST_DEAD:
        found.append(f'{100.0 * dead:.0f} % of the tactels are dead: check the wiring')
    if fit is None:
        return found
    if fit.scatter > MOST_LEFT_OUT:
        found.append(f'{100.0 * fit.scatter:.0f} % of the pressure is not that of a ball of '
                     f'{1e3 * ball_radius:g} mm radius (usual: less than '
                     f'{100.0 * MOST_LEFT_OUT:.0f} %): {check}')
    if not USUAL_PATCH[0] < fit.patch < USUAL_PATCH[1]:
        found.append(f'the ball touches within {fit.patch:.2f} of its radius (usual: '
                     f'{USUAL_PATCH[0]} to {USUAL_PATCH[1]}): {check}')
    if force is not None:
        pressure = float(np.median(force)) / (np.pi * (fit.patch * ball_radius)**2)
        if pressure > MOST_PRESSURE:
            found.append(f'a force of {np.median(force):g} N is a mean pressure of '
                         f'{1e-6 * pressure:.0f} MPa under the ball (usual for rubber: less than '
                         f'{1e-6 * MOST_PRESSURE:.0f} MPa): forces are in N, not in mN or g')
    if fit.groups[-1] + 1 < FEW_PRESSES:
        found.append(f'only {fit.groups[-1] + 1} presses at different places, '
                     f'{FEW_PRESSES} and more are needed')
    if fit.depth_std > MOST_UNCERTAIN * fit.skin.depth:
        found.append(f'the depth is only known within {1e3 * fit.depth_std:.2f} mm')
    if fit.spread > MOST_SPREAD:
        found.append(f'the gains of the tactels differ by {100.0 * fit.spread:.0f} %')
    return found


def verdict(calibration: Calibration, fit: SkinFit | None) -> str:
    """Return the accuracy of force, depth and thickness, and the dead tactels, in one line."""
    parts = []
    if calibration.unit == 'Pa' and fit is not None:
        force = np.hypot(calibration.force_std, fit.force_left)
        parts.append(f'good for +-{100.0 * force:.1f} % of force')
    elif calibration.unit == 'Pa':
        parts.append('forces by the gain that was given')
    else:
        parts.append('good for places and directions, not for forces')
    if fit is not None and fit.depth_std > 0.0:
        parts.append(f'depth {_mm(fit.skin.depth, fit.depth_std)}')
        if not fit.skin.is_half_space:
            parts.append(f'thickness {_mm(fit.skin.thickness, fit.thickness_std)}')
    dead = named(~calibration.live)
    return '; '.join([*parts, f'{dead} dead' if dead else 'no tactel dead'])


def _mm(value: float, std: float) -> str:
    digits = int(np.clip(-np.floor(np.log10(max(1e3 * std, 1e-9))), 0, 3))
    return f'{1e3 * value:.{digits}f} +- {1e3 * std:.{digits}f} mm'


def named(some: np.ndarray) -> str:
    """Return the names of marked tactels (rows, columns); whole rows and columns as such."""
    rows, columns = np.asarray(some.all(axis=1)), np.asarray(some.all(axis=0))
    rest = some & ~rows[:, None] & ~columns
    alone = ', '.join(f'({row}, {column})' for row, column in np.argwhere(rest))
    names = [f'tactels {alone}'] if alone else []
    return ', '.join([*names, *(f'row {k}' for k in np.flatnonzero(rows)),
                      *(f'column {k}' for k in np.flatnonzero(columns))])


def draw_report(calibration: Calibration, presses: Presses | None, fit: SkinFit | None,
                path: str | Path) -> None:
    """Draw noise, gains, and what the fit leaves of the presses, into a picture file."""
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, 3, figsize=(12, 7.5), layout='constrained')
    _map(figure, axes[0, 0], calibration.noise, 'noise of every tactel [counts]')
    relative = calibration.gain / calibration.gain[calibration.live].mean()
    _map(figure, axes[0, 1], np.where(calibration.live, relative, np.nan),
         'gain of every tactel, relative')
    if fit is None or presses is None:
        for axis in (axes[0, 2], *axes[1]):
            axis.axis('off')
        axes[0, 2].text(0.0, 0.5, 'no presses of a ball: skin and gains are assumed')
    else:
        left, top = presses.values - fit.models, np.nanmax(fit.models, axis=(1, 2))
        strongest = int(top.argmax())
        _map(figure, axes[0, 2], np.where(calibration.live, 100.0 * fit.gain_std, np.nan),
             '+- of every gain [%]')
        _map(figure, axes[1, 0], presses.values[strongest],
             f'frame {presses.number[strongest]} [counts]')
        _map(figure, axes[1, 1], left[strongest], 'left of it by the fit [counts]')
        axes[1, 2].plot(100.0 * np.sqrt(np.nanmean(left**2, axis=(1, 2))) / top, 'o')
        axes[1, 2].set(title='left of every press', ylabel='RMS over the peak [%]',
                       xlabel='press', ylim=(0.0, None))
    figure.suptitle(f'{calibration.array.rows} x {calibration.array.columns} tactels: '
                    + verdict(calibration, fit))
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def _map(figure: Any, axis: Any, values: np.ndarray, title: str) -> None:
    picture = axis.imshow(values, origin='lower')
    axis.set_title(title, fontsize=10)
    figure.colorbar(picture, ax=axis, shrink=0.8)
