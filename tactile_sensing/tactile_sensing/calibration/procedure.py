"""Make a calibration from recordings of raw counts, with every step that they allow."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
import math
from typing import Any

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.calibration.likelihood import ASSUMED_POISSON, POISSON_STD, UNLIKE
from tactile_sensing.calibration.presses import PER_PRESS, Presses, why_not
from tactile_sensing.calibration.report import doubts
from tactile_sensing.calibration.skin_fit import fit_presses, SkinFit
from tactile_sensing.calibration.survey import range_of, survey, Tactels, TOUCHED, touched
from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.devices.tare import MIN_TARE_FRAMES, QUANTISATION
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.skin import Skin

FEWEST_PRESSES = 5  # of a ball, to fit a skin; twenty are better
MOST_PRESSES = 120  # of a file; more cost time and add little information
UNPRESSED = 0.03  # tactels far from a press read less than this share of its peak
MOST_TOUCHED = 0.2  # share of the unloaded frames that may be left out
# If this share of a row or column is dead, its tactels that were not loaded count as dead too.
DEAD_LINE = 0.25


@dataclass
class Known:
    """Known values from data sheet or measurement; None, or a length or gain of 0: unknown."""

    pitch: tuple[float, float]  # along x and y [m]
    bits: int | None = None
    signed: bool | None = None
    threshold: int | None = None
    saturation: int | None = None
    depth: float = 0.0  # [m]
    thickness: float = 0.0  # [m]
    poisson: float | None = None
    gain: float = 0.0  # [Pa/count]
    tactel: str = 'area'
    resolution: float = 1.0  # size of one count in the unit of the recordings
    ball_radius: float = 0.0  # [m]
    force: np.ndarray | None = None  # (N,): of the frames of `ball`; or one for all [N]


def calibrate(recordings: Mapping[str, np.ndarray], known: Known,
              tell: Callable[[str], None] = lambda text: None) -> 'Procedure':
    """
    Make a calibration from recordings and known values; `tell` is called with each step's name.

    The recordings are `unloaded`, `corners`, `rolling`, `ball` and `flat`, each optional: frames
    (N, raw rows, raw columns) in counts.

    Raises
    ------
    ConfigurationError
        If recordings contradict each other or are not sufficient.
    """
    if not recordings:
        raise ConfigurationError('no recordings: give at least one of --unloaded, --ball, --flat')
    raw_shape = next(iter(recordings.values())).shape[1:]
    for frames in recordings.values():
        if frames.shape[1:] != raw_shape:
            raise ConfigurationError(f'recordings have frames of {raw_shape[0]} x {raw_shape[1]} '
                                     f'and of {frames.shape[1]} x {frames.shape[2]} tactels')
    if known.bits is None and recordings.keys() == {'unloaded'}:
        raise ConfigurationError('--bits is missing: frames of the unloaded pad do not show the '
                                 'range of its converter')
    tell('range and noise')
    procedure = Procedure(recordings, known, tell)
    procedure.find_range()
    procedure.find_order(raw_shape)
    if 'unloaded' in recordings:
        procedure.survey_unloaded(recordings['unloaded'])
    else:
        procedure.assumed.append(
            'a baseline of 0 and a noise of one count: no frames without load')
        procedure.values['noise'] = 1.0
    if not known.depth:
        procedure.assumed.append('tactels one pitch below the surface, as no ball says it')
    if 'ball' in recordings or 'flat' in recordings:
        procedure.find_skin()
    procedure.finish()
    return procedure


@dataclass
class Procedure:
    """A calibration, what it was made from, and the data for its report."""

    recordings: Mapping[str, np.ndarray]
    known: Known
    tell: Callable[[str], None]
    values: dict[str, Any] = field(default_factory=dict)  # fields of the calibration so far
    found: dict[str, Any] = field(default_factory=dict)
    assumed: list[str] = field(default_factory=list)
    left_out: dict[str, dict[int, str]] = field(default_factory=dict)  # file -> frame -> reason
    tactels: Tactels | None = None
    presses: Presses | None = None
    skin: SkinFit | None = None
    calibration: Calibration = field(init=False)
    doubts: list[str] = field(default_factory=list)  # reasons not to trust it

    def find_range(self) -> None:
        """Set the range of the counts, and skin and gain if they are known."""
        known = self.known
        counts, self.assumed = range_of(
            list(self.recordings.values()), known.bits, known.signed, known.threshold)
        self.values = {
            'bits': counts.bits, 'signed': counts.signed, 'threshold': counts.threshold,
            'saturation': counts.saturation if known.saturation is None else known.saturation,
            'tactel': known.tactel, 'resolution': known.resolution,
            'depth': known.depth or min(known.pitch),
            'thickness': known.thickness,
            'poisson': ASSUMED_POISSON if known.poisson is None else known.poisson}
        self.values |= {'gain': known.gain} if known.gain else {'unit': 'counts'}

    def find_order(self, raw_shape: tuple[int, ...]) -> None:
        """Set order and size of the image."""
        corners, transposed = self.recordings.get('corners'), False
        if corners is None:
            self.assumed.append('rows and columns as they come')
        elif len(corners) != 4:
            raise ConfigurationError(f'corners: {len(corners)} frames, must be 4: of the first '
                                     'row and column, then round by the first row')
        else:
            unloaded = self.recordings.get('unloaded')
            base = 0.0 if unloaded is None else np.median(unloaded, axis=0)
            row_order, column_order, transposed = order_of(corners - base)
            self.found['order'] = ('turned or mirrored by corners'
                                   if transposed or row_order or column_order
                                   else 'as they come, by the corners')
            self.values |= {'row_order': row_order, 'column_order': column_order}
        rows, columns = raw_shape[::-1] if transposed else raw_shape
        self.values |= {'array': TactelArray(rows, columns, *self.known.pitch),
                        'transposed': transposed}

    def survey_unloaded(self, unloaded: np.ndarray) -> None:
        """Set baseline, noise and dead tactels."""
        draft, total = Calibration(**self.values), len(unloaded)
        bad = touched(draft.arrange(unloaded), draft.counts)
        if bad.mean() > MOST_TOUCHED:
            raise ConfigurationError(
                f'unloaded: something touches the pad in {bad.sum()} of {total} frames, first in '
                f'frame {bad.argmax()}: record it again')
        self.left_out['unloaded'] = dict.fromkeys(
            np.flatnonzero(bad).tolist(), 'something touches the pad')
        unloaded = unloaded[~bad]
        if len(unloaded) < MIN_TARE_FRAMES:
            raise ConfigurationError(f'unloaded: {len(unloaded)} frames, at least '
                                     f'{MIN_TARE_FRAMES} are needed')
        # Without the corners: a finger there may miss the tactels.
        self.tactels = tactels = survey(draft.arrange(unloaded), draft.counts, [
            draft.arrange(self.recordings[name]) for name in ('ball', 'flat', 'rolling')
            if name in self.recordings])
        self.found['unloaded'] = {
            'frames': len(unloaded), 'noise': _short(np.sqrt(np.mean(tactels.noise**2))),
            'step': tactels.step,
            'dead': {f'{row},{column}': why for (row, column), why in tactels.dead.items()},
            'not_loaded': int(tactels.unloaded.sum())}
        # Keep the offset within the allowed range of a baseline.
        self.values |= {
            'baseline': np.clip(tactels.offset, draft.counts.lowest, draft.counts.saturation - 1),
            'noise': tactels.noise, 'dead_tactels': tuple(sorted(
                row * draft.array.columns + column for row, column in tactels.dead))}

    def find_skin(self) -> None:
        """Set skin, gain and flat field from presses of the ball."""
        recordings, known = self.recordings, self.known
        if not known.ball_radius > 0.0:
            raise ConfigurationError('--ball-radius is missing')
        draft = Calibration(**self.values)
        names = [name for name in ('ball', 'flat') if name in recordings]
        files = [self._sorted(name, k, draft) for k, name in enumerate(names)]
        presses = replace(files[0], **{
            name: np.concatenate([getattr(it, name) for it in files]) for name in PER_PRESS})
        offset_std = np.maximum(draft.noise, QUANTISATION**0.5)
        if 'unloaded' in recordings:
            offset_std = offset_std / len(recordings['unloaded'])**0.5
        _check_unloaded(presses, 'unloaded' in recordings)
        forced = known.force is not None and 'ball' in recordings
        given = draft.layer().skin if known.depth else None

        def fit(chosen: np.ndarray) -> SkinFit:
            self.tell(f'skin and gains from {chosen.sum()} presses')
            return fit_presses(presses.only(chosen), known.ball_radius,
                               area=known.tactel == 'area', known=given, poisson=known.poisson,
                               offset_std=offset_std)
        chosen = np.ones(len(presses), bool)
        skin = fit(chosen)
        bad = skin.misfit > UNLIKE * np.median(skin.misfit)
        if bad.any() and len(np.unique(skin.groups[~bad])) >= FEWEST_PRESSES:
            for k, number in zip(presses.source[bad], presses.number[bad], strict=True):
                self.left_out[names[k]][int(number)] = 'unlike the others: no ball, or it moved'
            chosen = ~bad
        of_ball = int((presses.source[chosen] == 0).sum())
        if forced and of_ball < FEWEST_PRESSES:
            raise ConfigurationError(
                f'ball: only {of_ball} presses of known force are like the others, at least '
                f'{FEWEST_PRESSES} are needed')
        if not chosen.all():
            skin = fit(chosen)
        self.presses, self.skin = presses.only(chosen), skin
        self._use(skin, given, ~draft.live)
        if forced and not known.gain:
            # The known forces are those of the ball, which is the first source.
            self.values |= {'gain': skin.gain / skin.level[0], 'unit': 'Pa',
                            'force_std': skin.edge_force_std}
            self.found['force'] = {
                'presses': self.found['gains']['presses'],
                'gain': _short(1.0 / skin.level[0]), 'gain_std': _short(skin.level_std)}

    def _sorted(self, name: str, source: int, draft: Calibration) -> Presses:
        """Return the usable presses of a recording; frames of a held press are averaged."""
        frames, count = self.recordings[name], len(self.recordings[name])
        known = self.known.force if name == 'ball' else None
        force = np.broadcast_to(1.0 if known is None else known, count)
        arranged = draft.arrange(np.asarray(frames, dtype=np.float64))
        full = draft.full(arranged)
        noise = np.broadcast_to(np.maximum(draft.noise, QUANTISATION**0.5), arranged.shape)
        values = np.where(draft.live & ~full, arranged - draft.baseline, np.nan)
        floor = draft.counts.threshold - 0.5 - draft.baseline.astype(float)
        reasons = [why_not(image, std, draft.array, int(saturated)) for image, std, saturated
                   in zip(values, noise, full.sum((1, 2)), strict=True)]
        self.left_out[name] = bad = {k: why for k, why in enumerate(reasons) if why}
        good = Presses(
            draft.array, values, noise, floor, np.arange(count), np.full(count, source),
            force).only(np.array([not why for why in reasons]))
        good = good.averaged() if len(good) else good
        # Evenly in time.
        some = np.linspace(0, len(good) - 1, min(len(good), MOST_PRESSES))
        good = good.only(np.rint(some).astype(int))
        if len(good) < FEWEST_PRESSES:
            why = [f'frame {k}: {text}' for k, text in list(bad.items())[:3]]
            raise ConfigurationError('; '.join([
                f'{name}: only {count - len(bad)} of {count} frames show one press, '
                f'{len(good)} different ones, at least {FEWEST_PRESSES} are needed', *why]))
        return good

    def _use(self, fit: SkinFit, given: Skin | None, dead: np.ndarray) -> None:
        """Set the fields of the calibration that follow from the fit."""
        count, known, found = int(fit.groups[-1]) + 1, self.known, self.found
        self.values |= {'gain_spread': float(fit.left), 'gain': (known.gain or 1.0) * fit.gain}
        found['gains'] = {
            'presses': count, 'spread': _short(fit.spread), 'left': _short(fit.left)}
        if not given:
            self.assumed.pop()  # the assumption about the depth
            thickness = 0.0 if fit.skin.is_half_space else float(fit.skin.thickness)
            self.values |= {'depth': float(fit.skin.depth), 'poisson': float(fit.skin.poisson),
                            'thickness': thickness}
            found['skin'] = {
                'presses': count, 'depth_std': _short(fit.depth_std),
                'thickness_std': _short(fit.thickness_std),
                'poisson_std': _short(fit.poisson_std), 'left_out': _short(fit.scatter),
                'patch': _short(fit.patch)}
            if known.poisson is None:
                self.assumed.append(f"a Poisson's ratio of {ASSUMED_POISSON} +- {POISSON_STD}, "
                                    'beside what presses say of it')
        dead = dead | fit.dead
        if self.tactels is not None:
            idle = self.tactels.unloaded
            for some, spared in ((dead, idle), (dead.T, idle.T)):
                some[(some.mean(axis=1) >= DEAD_LINE) & (some | spared).all(axis=1)] = True
        for row, column in np.argwhere(dead):
            found.setdefault('unloaded', {}).setdefault('dead', {}).setdefault(
                f'{row},{column}', 'does not follow the load')
        self.values['dead_tactels'] = tuple(np.flatnonzero(dead).tolist())

    def finish(self) -> None:
        """Set the calibration and reasons to doubt it."""
        if not self.known.gain and self.known.force is None:
            self.assumed.append('no force is known: only place, yaw and type can be estimated')
        self.found['assumed'] = self.assumed
        self.calibration = Calibration(
            model='calibrated', source='calibrate', found=self.found, **self.values)
        self.doubts = doubts(self.skin, self.known.ball_radius,
                             float(np.mean(~self.calibration.live)), self.known.force)
        if self.doubts:
            self.found['doubtful'] = self.doubts


def order_of(corners: np.ndarray) -> tuple[tuple, tuple, bool]:
    """
    Return `row_order`, `column_order` and `transposed` of a `Calibration`; empty: unchanged.

    `corners` (4, raw rows, raw columns) are frames of presses in the corners of the image: first
    row and column; first row, last column; last row and column; last row, first column. Raises a
    ConfigurationError if they are no corners.
    """
    peaks = np.array([np.unravel_index(image.argmax(), image.shape) for image in corners])
    shape, within_row = corners.shape[1:], np.abs(peaks[[0, 3]] - peaks[[1, 2]]).sum(axis=0)
    transposed = bool(within_row[0] > within_row[1])
    if transposed:
        peaks, shape = peaks[:, ::-1], shape[::-1]
    orders: list[tuple] = []
    # Corners in the first and the last row; in the first and the last column.
    for axis, (first, last) in enumerate((([0, 1], [2, 3]), ([0, 3], [1, 2]))):
        apart = peaks[last, axis].mean() - peaks[first, axis].mean()
        if abs(apart) < 0.5 * shape[axis]:
            raise ConfigurationError(
                f'corners: {("rows", "columns")[axis]} of the corners are only {abs(apart):.0f} '
                f'of {shape[axis]} apart: press again, or give row_order and column_order in the '
                'file')
        orders.append(() if apart > 0.0 else tuple(reversed(range(shape[axis]))))
    return orders[0], orders[1], transposed


def _check_unloaded(presses: Presses, recorded: bool) -> None:
    """Raise a ConfigurationError if the tactels that nothing presses do not read 0."""
    each = presses.values.reshape(len(presses), -1)
    low = float(np.median(np.nanquantile(each, 0.05, axis=1)))
    allowed = UNPRESSED * float(np.median(np.nanmax(each, axis=1)))
    if not recorded and low > allowed:
        raise ConfigurationError(f'tactels that nothing presses read {low:.0f} counts: --unloaded '
                                 'is missing, frames of the unloaded pad')
    if recorded and -low > allowed + TOUCHED * float(np.median(presses.noise)):
        raise ConfigurationError(
            f'tactels that nothing presses read {-low:.0f} counts less than in --unloaded: '
            'something pressed the pad there, or it drifted or is another one; record it again')


def _short(value: float) -> float | str:
    """Return a number rounded to four digits for a file, or 'unknown'."""
    value = float(value)
    return float(f'{value:.4g}') if math.isfinite(value) else 'unknown'
