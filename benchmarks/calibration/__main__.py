"""
Accuracy of calibrations: finite-element images, digitised, calibrated and estimated.

All steps use the code of the commands `calibrate` and `estimate`. The tables are: sensors with
different gains (`gains`) and the best possible result for them (`bound`), converters (`counts`),
skins (`skins`) and objects on them (`objects`); the noise that is estimated from a single image if
none is given (`noise`); and edge tracking with sensors of the scene `real_skin` that differ in
their gains, each calibrated in the simulation (`specimens`).
"""

import argparse
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.calibration.bound import bound
from benchmarks.contact.fe_frames import DEPTH, profiles
from benchmarks.contact.real_skin import ARRAYS, drawn, estimates, judge, rendered
from benchmarks.edge import runs
from benchmarks.harness import Steps, table
from tactile_sensing.calibration.procedure import calibrate, Known
from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.devices.calibration import save_calibration
from tactile_sensing.types.array import TactelArray
from tactile_simulation.ball_press import BallPress

NOISE = 0.01  # as a share of the highest tactel: 40 dB
SIDES = 5, 6, 8, 12, 16, 32  # of pads
FOLLOWED = {'real_skin': 0.03, 'real_skin_course': 0.1}  # scenes of one sensor, speeds [m/s]
BALL, FORCE = 3e-3, 1.0  # m, N: radius and force of the ball
WIDE = 11e-3  # m, largest distance from the middle of presses for the gains


@dataclass(frozen=True)
class Converter:
    """Conversion of pressure to counts."""

    bits: int = 12
    signed: bool = False
    offset: float = 0.05  # of full scale
    threshold: float = 0.0  # standard deviations of noise; smaller values become zero
    exact: bool = False  # floats, not counts

    @property
    def full(self):
        """Full scale [counts]."""
        return 2.0 ** (self.bits - self.signed) - 1.0

    @property
    def peak(self):
        """Counts of the highest tactel."""
        return 0.8 * self.full

    def __call__(self, pictures, rng, gains=1.0):
        """Convert images whose highest value is 1 to counts."""
        noise = NOISE * self.peak
        counts = self.peak * gains * pictures + self.offset * self.full
        counts = counts + noise * rng.standard_normal(pictures.shape)
        if self.exact:
            return counts
        counts = np.rint(counts)
        if self.threshold:
            counts[counts < self.threshold * noise] = 0.0
        return np.clip(counts, -self.full - 1.0 if self.signed else 0.0, self.full)


def ball(backing, poisson=0.45, radius=1e-3):
    """Return the profile of a ball."""
    [found] = [it for it in profiles() if it['kind'] == 'ball' and it['radius'] == radius
               and it['backing'] == backing and it['poisson'] == poisson]
    return found


def pad(profile, array, converter, rng, *, gains=1.0, presses=20, flat=0, least=1.0, held=1,
        poisson=None):
    """
    Return the Procedure of a calibration from presses of a ball.

    Each press has a random force, from `least` times the profile's force to all of it, and lasts
    `held` frames.
    """
    highest = profile['pressure'].max()

    def pressed(count, reach):
        places, share = rng.uniform(-reach, reach, (count, 2)), rng.uniform(least, 1.0, count)
        pictures = rendered(profile, array, places) * (share / highest)[:, None, None]
        return (converter(np.repeat(pictures, held, axis=0), rng, gains),
                np.repeat(share, held) * profile['force'])
    unloaded = converter(np.zeros((100, *array.shape)), rng)
    frames, force = pressed(presses, 8e-3)
    recordings = {'unloaded': unloaded, 'ball': frames}
    if flat:
        recordings['flat'] = pressed(flat, WIDE)[0]
    return calibrate(recordings, Known(
        (array.pitch_x, array.pitch_y), bits=converter.bits, signed=converter.signed,
        poisson=poisson, force=force, ball_radius=float(profile['radius'])))


def estimated(calibration, counts, **config):
    """Return the estimates of frames of counts."""
    estimator = ContactEstimator(EstimatorConfig(tactel='area', **config))
    return estimator.estimate_batch(
        calibration.stress(counts), calibration.array, [calibration.layer()])


def points(found, places, force):
    """Return the valid share, and errors of place and force, also relative to the claims."""
    good = found['valid'] & (found['type'] == 1)
    off = np.stack([found['x'], found['y']], -1)[good] - places[good]
    own = np.sqrt(np.stack([found['covariance'][good, k, k] for k in (0, 1)], -1))
    error = found['normal_force'][good] / force - 1.0
    claimed = np.sqrt(found['covariance'][good, 3, 3]) / force
    return {'valid': good.mean(), 'place': _rms(off), 'claim': _rms(off / own),
            'bias': error.mean(), 'spread': error.std(), 'force_claim': _rms(error / claimed)}


def _rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def _row(name, row):
    return [name, f'{100.0 * row["valid"]:.1f} %', f'{1e3 * row["place"]:.4f}',
            f'{row["claim"]:.2f}', f'{100.0 * row["bias"]:+.2f} %',
            f'{100.0 * row["spread"]:.2f} %', f'{row["force_claim"]:.2f}']


HEADER = ['valid', 'place [mm]', 'over claim', 'force', 'spread', 'over claim']


def gains(seeds):
    """Test gains with 10 % scatter, before and after forty presses all over the pad."""
    profile, array, rows = ball(6e-3), ARRAYS['16x16'], {}
    highest = profile['pressure'].max()
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        spread = 1.0 + 0.1 * rng.standard_normal(array.shape)
        places = drawn(profile, 200, rng)
        pictures = rendered(profile, array, places) / highest
        for name, gain, flat, least, held in (
                ('uniform', 1.0, 0, 1.0, 1),
                ('off, forty presses of one weight', spread, 40, 1.0, 1),
                ('off, forty presses of one weight, ten frames each', spread, 40, 1.0, 10),
                ('off, forty presses of any force', spread, 40, 0.5, 1),
                ('off, forty presses of any force, ten frames each', spread, 40, 0.5, 10),
                ('off, none', spread, 0, 1.0, 1)):
            converter = Converter()
            known = pad(profile, array, converter, rng, gains=gain, flat=flat, least=least,
                        held=held).calibration
            found = estimated(known, converter(pictures, rng, gain))
            row = points(found, places, profile['force'])
            inner = (known.gain * gain)[3:-3, 3:-3]
            row['left'] = np.std(inner / inner.mean())
            row['claimed'] = known.gain_spread
            rows.setdefault(name, []).append(row)
    return table(['gains', *HEADER, 'left, inner', 'claimed'], [
        _row(name, mean := {key: np.sqrt(np.mean([row[key]**2 for row in some]))
                            for key in some[0]})
        + [f'{100.0 * mean["left"]:.1f} %', f'{100.0 * mean["claimed"]:.1f} %']
        for name, some in rows.items()])


CONVERTERS = {
    'floats': Converter(exact=True, bits=16),
    **{f'signed, {bits} bits': Converter(bits, True, 0.0) for bits in (6, 8, 10, 16)},
    **{f'unsigned with offset, {bits} bits': Converter(bits) for bits in (6, 8, 10, 12, 16)},
    **{f'clipped at zero, {bits} bits': Converter(bits, offset=0.0) for bits in (6, 8, 10, 16)},
    **{f'threshold of 5 sigma, {bits} bits': Converter(bits, offset=0.0, threshold=5.0)
       for bits in (6, 8, 10, 16)},
}


def counts(seeds):
    """Test the same frames with different converters."""
    profile, array, rows = ball(6e-3), ARRAYS['16x16'], {}
    highest = profile['pressure'].max()
    for seed in range(seeds):
        for name, converter in CONVERTERS.items():
            rng = np.random.default_rng(seed)
            places = drawn(profile, 200, rng)
            pictures = rendered(profile, array, places) / highest
            known = pad(profile, array, converter, rng).calibration
            row = points(estimated(known, converter(pictures, rng)), places, profile['force'])
            allowed = np.hypot(1.0, 0.0 if converter.exact else (
                12**-0.5 / (NOISE * converter.peak)))
            rows.setdefault(name, []).append(row | {'allowed': allowed})
    means = {name: {key: np.sqrt(np.mean([row[key]**2 for row in some])) for key in some[0]}
             for name, some in rows.items()}
    first = means['floats']['place']
    return table(['converter', *HEADER, 'place over what noise and rounding allow'], [
        [*_row(name, mean), f'{mean["place"] / first / mean["allowed"]:.2f}']
        for name, mean in means.items()])


def objects(seeds):
    """Test balls, wedges and punches on skins, each calibrated from twenty presses."""
    rows, frames = {}, 40
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        for size, array in ARRAYS.items():
            skins = {}
            for profile in profiles():
                skin = float(profile['backing']), float(profile['poisson'])
                if skin not in skins:
                    skins[skin] = pad(ball(*skin), array, Converter(), rng).calibration
                places = drawn(profile, frames, rng)
                pictures = rendered(profile, array, places)
                found = estimated(skins[skin], Converter()(pictures / pictures.max(), rng))
                judged = judge(profile, places, scaled(found, pictures.max(), skin))
                blunt = np.mean(~found['valid'] | (found['patch'] > 0.0))
                rows.setdefault((size, str(profile['kind'])), []).append((judged, blunt))
    return table(['tactels', 'object', 'right', 'wrong', 'refused', 'patch or refused', 'force',
                  'at most', 'over claim', 'force over claim'], [
        [size, kind, *(f'{100.0 * np.mean([getattr(it, key) for it, _ in some]):.1f} %'
                       for key in ('right', 'wrong', 'refused')),
         f'{100.0 * np.mean([blunt for _, blunt in some]):.1f} %',
         f'{100.0 * np.nanmean([it.force for it, _ in some]):+.2f} %',
         f'{100.0 * np.nanmax(np.abs([it.force for it, _ in some])):.2f} %',
         f'{np.sqrt(np.nanmean([it.claims**2 for it, _ in some])):.2f}',
         f'{np.sqrt(np.nanmean([it.force_claims**2 for it, _ in some])):.2f}']
        for (size, kind), some in rows.items()])


def skins(seeds):
    """Test the skins that twenty presses of a ball give."""
    rows, array = [], ARRAYS['16x16']
    for backing, poisson in sorted({(float(it['backing']), float(it['poisson']))
                                    for it in profiles()}):
        found = [pad(ball(backing, poisson), array, Converter(),
                     np.random.default_rng(seed)).calibration for seed in range(seeds)]
        off = np.array([it.depth / DEPTH - 1.0 for it in found])
        claimed = np.array([it.found['skin']['depth_std'] / DEPTH for it in found])
        seen = [it for it in found if it.thickness]
        thick = np.array([it.thickness - backing for it in seen])
        thick_claimed = np.array([it.found['skin']['thickness_std'] for it in seen])
        rows.append([f'{1e3 * backing:g}', f'{poisson:g}', f'{100.0 * _rms(off):.1f} %',
                     f'{100.0 * np.abs(off).max():.1f} %', f'{100.0 * _rms(claimed):.1f} %',
                     f'{_rms(off / claimed):.2f}',
                     ', '.join(f'{1e3 * it.thickness:.2f}' if it.thickness else 'none'
                               for it in found),
                     f'{1e3 * _rms(thick_claimed):.2f}' if seen else '',
                     f'{_rms(thick / thick_claimed):.2f}' if seen else '',
                     f'{100.0 * _rms([it.force_std for it in found]):.2f} %'])
    return table(['backing [mm]', "Poisson's ratio", 'depth, RMS', 'at most', 'claimed',
                  'over claim', 'thickness found [mm]', 'claimed', 'over claim',
                  'force_std'], rows)


def noise(seeds):
    """Compare the noise found in single images with the true one: medians of 100 per seed."""
    rows = []
    for side in SIDES:
        found = []
        for pitch, profile, decibels in product((1e-3, 1.6e-3), profiles(), (20, 30, 40, 50)):
            if (profile['kind'] in ('ball', 'wedge') and profile['poisson'] == 0.45
                    and profile['backing'] in (4e-3, np.inf)):
                rng, array = np.random.default_rng(0), TactelArray(side, side, pitch, pitch)
                angle = np.pi / 2 if profile['kind'] == 'wedge' else 1.5 * pitch
                places = rng.uniform(-1.0, 1.0, (100 * seeds, 2)) * (1.5 * pitch, angle)
                pictures = rendered(profile, array, places)
                pictures /= pictures.max(axis=(1, 2), keepdims=True)
                pictures += 10.0**(-decibels / 20.0) * rng.standard_normal(pictures.shape)
                snr = estimates(profile, array, pictures, 0.0)['snr']
                found.append(10.0**((decibels - snr[np.isfinite(snr)]) / 20.0))
        medians = [np.median(some) for some in found]
        rows.append([f'{side}x{side}', f'{len(found)}', f'{min(medians):.2f}',
                     f'{max(medians):.2f}', *(f'{value:.2f}' for value in np.quantile(
                         np.concatenate(found), (0.1, 0.9)))])
    return table(['tactels', 'cases', 'least median', 'largest', 'a tenth of all below',
                  'and above'], rows)


def specimens(seeds):
    """Track edges with six sensors per seed, calibrated by sixty presses of a ball."""
    rows = {name: [] for name in FOLLOWED}
    with TemporaryDirectory() as folder, Steps(6 * seeds) as steps:
        for number in range(6 * seeds):
            steps.step(f'sensor {1 + number}')
            path = Path(folder, f'{number}.yaml')
            scenes = {name: _with_specimen(runs.shipped(name), 1 + number) for name in FOLLOWED}
            save_calibration(pressed(scenes['real_skin'], number), path)
            for name, scene in scenes.items():
                rows[name].append(runs.follow(
                    replace(scene, calibration=path), 'trace', FOLLOWED[name], number)[1])
    return table(['scene', 'speed [mm/s]', 'sensors', 'goals met', 'lateral RMS [mm]', 'largest',
                  'force RMS [N]', 'force, largest [N]'], [
        [name, f'{1e3 * FOLLOWED[name]:.0f}', f'{len(some)}', f'{sum(it["ok"] for it in some)}',
         ' to '.join(f'{1e3 * end([it["lateral_rms"] for it in some]):.4f}' for end in (min, max)),
         f'{1e3 * max(it["lateral_max"] for it in some):.3f}',
         f'{max(it["force_rms_error"] for it in some):.3f}',
         f'{max(it["force_max"] for it in some):.2f}'] for name, some in rows.items()])


def _with_specimen(scene, number):
    return replace(scene, sensor=replace(scene.sensor, specimen=number))


def pressed(scene, seed):
    """Calibrate a scene's sensor in the same way as `press_ball` and `calibrate`."""
    press = BallPress(scene, BALL, FORCE, seed)
    unloaded, ball, flat = press.unloaded(100), press.frames(20), press.frames(40)
    return calibrate({'unloaded': unloaded, 'ball': ball, 'flat': flat}, Known(
        (scene.sensor.pitch_x, scene.sensor.pitch_y), ball_radius=BALL,
        force=np.full(len(ball), FORCE))).calibration


def scaled(found, highest, skin):
    """Convert forces of images that the converter scaled to their highest pressure."""
    found = found.copy()
    factor = highest / ball(*skin)['pressure'].max()
    for name, row in (('normal_force', 3), ('line_force', 6)):
        found[name] *= factor
        found['covariance'][:, row, row] *= factor**2
    return found


TABLES = {'gains': gains, 'bound': bound, 'counts': counts, 'skins': skins,
          'objects': objects, 'noise': noise, 'specimens': specimens}


def main():
    """Print the tables."""
    parser = argparse.ArgumentParser(
        prog='./ws bench calibration', description=__doc__.strip(),
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('tables', nargs='*', metavar='TABLE', help=f'of {", ".join(TABLES)}')
    parser.add_argument('--seeds', type=int, default=2, help='(default: %(default)s)')
    options = parser.parse_args()
    for name in set(options.tables) - TABLES.keys():
        parser.error(f'{name!r} is no table; there are {", ".join(TABLES)}')
    for name in options.tables or TABLES:
        print(TABLES[name](options.seeds), flush=True)


if __name__ == '__main__':
    main()
