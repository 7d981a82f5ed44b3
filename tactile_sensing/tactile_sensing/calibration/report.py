"""Draw the report of a calibration: noise, gains, and what the fit leaves of the presses."""

from pathlib import Path
from typing import Any

import numpy as np

from tactile_sensing.calibration.procedure import Outcome
from tactile_sensing.calibration.verdict import verdict


def draw_report(outcome: Outcome, path: str | Path) -> None:
    """Draw the report of a calibration with matplotlib into a picture file."""
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot

    calibration, presses, fit = outcome.calibration, outcome.presses, outcome.skin
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
