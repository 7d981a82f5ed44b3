"""From recordings of raw counts to a calibration: every step that its recordings allow."""

from collections.abc import Callable
from dataclasses import dataclass, field
import math

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.calibration.likelihood import ASSUMED_POISSON, POISSON_STD, UNLIKE
from tactile_sensing.calibration.order import solve_order
from tactile_sensing.calibration.presses import Presses, sort_presses
from tactile_sensing.calibration.skin_fit import edge_force_std, Fit, fit_presses
from tactile_sensing.calibration.unloaded import range_of, survey, Tactels
from tactile_sensing.calibration.verdict import doubts
from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.skin import Skin

FEWEST_UNLOADED = 20  # frames
FEWEST_PRESSES = 5  # of a ball, that tell a skin; some twenty are better
LINE = 0.25  # of a row or column: dead ones that make all that was not loaded dead
UNLOADED = 0.03  # of the peak, less than which tactels far from a press read


@dataclass
class Recordings:
    """
    What was recorded, frames of shape (N, raw rows, raw columns) in counts; None: not recorded.

    Lengths in m, forces in N.
    """

    unloaded: np.ndarray | None = None
    corners: np.ndarray | None = None
    rolling: np.ndarray | None = None
    ball: np.ndarray | None = None
    ball_radius: float = 0.0
    force: np.ndarray | None = None  # (N,) of the ball's frames, or one for all
    flat: np.ndarray | None = None


@dataclass
class Known:
    """What the maker publishes, or the user has measured; None and 0: to be found or assumed."""

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
    transposed: bool = False
    resolution: float = 1.0  # of a count, in the unit of the recordings

    @property
    def usual_poisson(self) -> float:
        """Poisson's ratio, where nobody knows it that of a soft skin."""
        return ASSUMED_POISSON if self.poisson is None else self.poisson


@dataclass
class Outcome:
    """A calibration, and what a report draws."""

    calibration: Calibration
    left_out: dict[str, dict[int, str]] = field(default_factory=dict)
    tactels: Tactels | None = None
    presses: Presses | None = None
    skin: Fit | None = None
    doubts: list[str] = field(default_factory=list)  # why not to trust it


def calibrate(recordings: Recordings, known: Known,
              tell: Callable[[str], None] = lambda text: None) -> Outcome:
    """
    Make a calibration.

    Raises
    ------
    ConfigurationError
        Recordings contradict each other, or tell too little.
    """
    given = [it for it in (recordings.unloaded, recordings.ball, recordings.flat,
                           recordings.corners, recordings.rolling) if it is not None]
    if not given:
        raise ConfigurationError('no recordings: give at least one of --unloaded, --ball, --flat')
    raw_shape = given[0].shape[1:]
    for frames in given:
        if frames.shape[1:] != raw_shape:
            raise ConfigurationError(f'recordings have frames of {raw_shape[0]} x {raw_shape[1]} '
                                     f'and of {frames.shape[1]} x {frames.shape[2]} tactels')
    if known.bits is None and all(it is None for it in (
            recordings.ball, recordings.flat, recordings.corners, recordings.rolling)):
        raise ConfigurationError('--bits is missing: frames of the unloaded pad do not show the '
                                 'range of its converter')
    tell('range and noise')
    found: dict = {}
    counts, assumed = range_of(given, known.bits, known.signed, known.threshold)
    values: dict = {'bits': counts.bits, 'signed': counts.signed, 'threshold': counts.threshold,
                    'saturation': known.saturation or counts.saturation, 'tactel': known.tactel,
                    'resolution': known.resolution,
                    'dead_tactels': ()}
    values |= _order(recordings, known, raw_shape, found, assumed)
    transposed = values.pop('_transposed')
    shape = raw_shape[::-1] if transposed else raw_shape
    (rows, columns), (pitch_x, pitch_y) = shape, known.pitch
    array = TactelArray(rows, columns, pitch_x, pitch_y)
    draft = Calibration(array, unit='counts', depth=min(known.pitch), transposed=transposed,
                        **values)
    outcome = Outcome(draft)
    values |= _unloaded(recordings, draft, outcome, found, assumed)
    draft = Calibration(array, unit='counts', depth=min(known.pitch), transposed=transposed,
                        **values)
    values |= {'unit': 'counts', 'depth': known.depth or min(known.pitch),
               'thickness': known.thickness, 'poisson': known.usual_poisson}
    if not known.depth:
        assumed.append('tactels one pitch below the surface, as no ball says it')
    if known.gain:
        values |= {'unit': 'Pa', 'gain': known.gain}
    if recordings.ball is not None or recordings.flat is not None:
        values |= _skin(recordings, known, draft, outcome, found, assumed, tell)
    if not known.gain and recordings.force is None:
        assumed.append('no force is known: places, yaw and type can be told, forces cannot')
    found['assumed'] = assumed
    outcome.doubts = doubts(outcome.skin, recordings.ball_radius, len(values['dead_tactels']) / (
        rows * columns))
    if outcome.doubts:
        found['doubtful'] = outcome.doubts
    outcome.calibration = Calibration(array, transposed=transposed, model='calibrated',
                                      source='calibrate', found=found, **values)
    return outcome


def _order(recordings, known, raw_shape, found, assumed):
    if recordings.corners is None:
        assumed.append('rows and columns as they come')
        return {'_transposed': known.transposed}
    if len(recordings.corners) != 4:
        raise ConfigurationError(f'corners: {len(recordings.corners)} frames, must be 4: of the '
                                 'first row and column, then round by the first row')
    shape = raw_shape[::-1] if known.transposed else raw_shape
    base = np.median(recordings.unloaded, axis=0) if recordings.unloaded is not None else 0.0
    rolling = None if recordings.rolling is None else recordings.rolling - base
    rows, columns, transposed = solve_order(recordings.corners - base, rolling, shape)
    plain = (rows, columns, transposed) == (tuple(range(shape[0])), tuple(range(shape[1])), False)
    found['order'] = 'as they come, by the corners' if plain else (
        'turned, mirrored or sorted by corners' + ' and a rolling press' * (rolling is not None))
    return {'row_order': rows, 'column_order': columns, '_transposed': transposed} if not plain \
        else {'_transposed': False}


def _unloaded(recordings, draft, outcome, found, assumed):
    if recordings.unloaded is None:
        assumed.append('a baseline of 0 and a noise of one count: no frames without load')
        return {'noise': 1.0}
    if len(recordings.unloaded) < FEWEST_UNLOADED:
        raise ConfigurationError(f'unloaded: {len(recordings.unloaded)} frames, at least '
                                 f'{FEWEST_UNLOADED} are needed')
    loaded = [draft.arrange(it) for it in (recordings.ball, recordings.flat, recordings.rolling)
              if it is not None]
    tactels = survey(draft.arrange(recordings.unloaded), draft.counts, loaded)
    outcome.tactels = tactels
    columns = draft.array.columns
    usual = np.sqrt(np.mean(tactels.noise**2))
    found['unloaded'] = {
        'frames': len(recordings.unloaded), 'noise': _short(usual), 'step': tactels.step,
        'drift': _short(tactels.drift),
        'dead': {f'{row},{column}': why for (row, column), why in tactels.dead.items()},
        'not_loaded': int(tactels.unloaded.sum())}
    # One frame of an unloaded pad may be that far off by chance.
    return {'baseline': np.clip(tactels.offset, draft.counts.lowest, draft.counts.saturation - 1),
            'noise': tactels.noise,
            'dead_tactels': tuple(sorted(row * columns + column for row, column in tactels.dead))}


def _presses(frames, calibration, force=None):
    """Frames as presses, and how many tactels of each are at full scale."""
    arranged = calibration.arrange(np.asarray(frames, dtype=np.float64))
    full = (arranged >= calibration.counts.saturation) & calibration.live
    noise = np.maximum(calibration.noise.astype(float), 12**-0.5)
    noise = np.broadcast_to(noise, arranged.shape)
    values = np.where(calibration.live & ~full, arranged - calibration.baseline, np.nan)
    floor = calibration.counts.threshold - 0.5 - calibration.baseline.astype(float)
    number = np.arange(len(values))
    return Presses(calibration.array, values, noise, floor, number), full.sum((1, 2))


def _sorted(name, frames, calibration, outcome):
    presses, saturated = _presses(frames, calibration)
    good, bad = sort_presses(presses, saturated)
    outcome.left_out[name] = bad
    if len(good) < FEWEST_PRESSES:
        why = '; '.join(f'frame {k}: {text}' for k, text in list(bad.items())[:3])
        raise ConfigurationError(
            f'{name}: only {len(frames) - len(bad)} of {len(frames)} frames show one press, '
            f'{len(good)} different ones, at least {FEWEST_PRESSES} are needed ({why})')
    return good


def _skin(recordings, known, draft, outcome, found, assumed, tell):
    """Skin, gain and flat field from presses of the ball."""
    if not recordings.ball_radius > 0.0:
        raise ConfigurationError('--ball-radius is missing')
    parts = {name: _sorted(name, frames, draft, outcome) for name, frames in (
        ('ball', recordings.ball), ('flat', recordings.flat)) if frames is not None}
    presses, *more = parts.values()
    for other in more:
        presses = presses.joined(other)
    source = np.repeat(np.arange(len(parts)), [len(part) for part in parts.values()])
    if recordings.unloaded is None:
        _check_unloaded(presses)
        offset_std = np.maximum(draft.noise, 12**-0.5)
    else:
        offset_std = np.maximum(draft.noise, 12**-0.5) / len(recordings.unloaded)**0.5
    told = np.ones(len(presses))
    forced = recordings.force is not None and recordings.ball is not None
    if forced:
        told[source == 0] = _force(recordings)[presses.number[source == 0]]
    given = Skin(known.depth, known.thickness or math.inf,
                 known.usual_poisson) if known.depth else None

    def fit(chosen):
        tell(f'skin and gains from {chosen.sum()} presses')
        return fit_presses(presses.only(chosen), recordings.ball_radius,
                           area=known.tactel == 'area', known=given, poisson=known.poisson,
                           told=told[chosen], source=source[chosen], offset_std=offset_std)
    chosen = np.ones(len(presses), bool)
    skin = fit(chosen)
    bad = skin.misfit > UNLIKE * np.median(skin.misfit)
    if bad.any() and len(np.unique(skin.groups[~bad])) >= FEWEST_PRESSES:
        for k, number in zip(source[bad], presses.number[bad], strict=True):
            outcome.left_out[list(parts)[k]][
                int(number)] = 'unlike the others: no ball, or it moved'
        chosen = ~bad
        skin = fit(chosen)
    presses = presses.only(chosen)
    if forced and (source[chosen] == 0).sum() < FEWEST_PRESSES:
        raise ConfigurationError(
            f'ball: only {(source[chosen] == 0).sum()} presses of known force are like the '
            f'others, at least {FEWEST_PRESSES} are needed')
    outcome.presses, outcome.skin = presses, skin
    return _found_skin(known, given, outcome, draft, forced, found, assumed)


def _found_skin(known, given, outcome, draft, forced, found, assumed):
    """What the fit says of the calibration."""
    fit, count = outcome.skin, int(outcome.skin.groups[-1]) + 1
    gain = fit.gain
    values: dict = {'gain_spread': float(fit.left)}
    found['gains'] = {'presses': count, 'spread': _short(fit.spread), 'left': _short(fit.left)}
    if not given:
        if assumed and assumed[-1].startswith('tactels one pitch'):
            assumed.pop()
        values |= {'depth': float(fit.skin.depth), 'poisson': float(fit.skin.poisson),
                   'thickness': 0.0 if fit.skin.is_half_space else float(fit.skin.thickness)}
        found['skin'] = {
            'presses': count, 'depth_std': _short(fit.depth_std),
            'thickness_std': _short(fit.thickness_std), 'poisson_std': _short(fit.poisson_std),
            'left_out': _short(fit.scatter), 'patch': _short(fit.patch)}
        if known.poisson is None:
            assumed.append(f"a Poisson's ratio of {ASSUMED_POISSON} +- {POISSON_STD}, beside "
                           'what presses say of it')
    if fit.dead.any() or not draft.live.all():
        dead = _with_lines(fit.dead | ~draft.live, outcome.tactels)
        for row, column in np.argwhere(dead):
            found.setdefault('unloaded', {}).setdefault('dead', {}).setdefault(
                f'{row},{column}', 'does not follow the load')
        values['dead_tactels'] = tuple(np.flatnonzero(dead).tolist())
    values['gain'] = known.gain * gain if known.gain else gain
    if forced and not known.gain:
        # Counts are those of the ball's level, which is the first source.
        values |= {'gain': gain / fit.level[0], 'unit': 'Pa', 'force_std': edge_force_std(
            outcome.presses, fit, 0, known.tactel == 'area')}
        found['force'] = {'presses': count, 'gain': _short(1.0 / fit.level[0]),
                          'gain_std': _short(fit.level_std(0) / fit.level[0])}
    return values


def _check_unloaded(presses):
    each = presses.values.reshape(len(presses), -1)
    low = float(np.median(np.nanquantile(each, 0.05, axis=1)))
    if low > UNLOADED * np.median(np.nanmax(each, axis=1)):
        raise ConfigurationError(f'tactels that nothing presses read {low:.0f} counts: --unloaded '
                                 'is missing, frames of the unloaded pad')


def _force(recordings):
    """Of every frame of the ball [N]."""
    return np.broadcast_to(np.asarray(recordings.force, float), len(recordings.ball))


def _with_lines(dead, tactels):
    """Dead tactels, and those of a row or column that is dead as far as it was loaded."""
    if tactels is not None:
        for some, idle in ((dead, tactels.unloaded), (dead.T, tactels.unloaded.T)):
            some[(some.mean(axis=1) >= LINE) & (some | idle).all(axis=1)] = True
    return dead


def _short(value):
    """Number of four digits, as a file shows it."""
    value = float(value)
    return float(f'{value:.4g}') if math.isfinite(value) else 'unknown'
