"""Pictures of the contact benchmark's limits: failure maps and the choice of model."""

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.contact.cases.faults import FAULTS
from benchmarks.contact.cases.scenes import ANSWERS

STYLES = {  # method -> colour, marker, line width, drawn above others
    'moments': ('#999999', 'v', 1.0, 1), 'compensated': ('#c05a00', '^', 1.0, 2),
    'fit with depth': ('#3c9d6a', 's', 1.4, 3), 'fit': ('#0b6e99', 'o', 1.8, 4)}
COLUMNS = (('rms_place_m', 1e3, 'RMS error of the place [mm]'),
           ('rms_force', 100.0, 'RMS error of the force [%]'),
           ('refused', 100.0, 'refused [% of frames]'),
           ('wrong', 100.0, 'wrong but confident [% of frames]'))
LIMITS = {'point': ((0.003, 5), (0.05, 200)), 'line': ((0.0007, 5), (0.015, 200))}
SAME = 'saturation as NaN'  # looks like a declared full scale


def faults_of(contact):
    """Failure map of one contact: a fault to a row, growing to the right."""
    def make(result):
        shown = [fault for fault in FAULTS if fault.name != SAME]
        figure, axes = plt.subplots(len(shown), 4, figsize=(10.5, 1.62 * len(shown) + 0.7),
                                    layout='constrained')
        rows = [r for r in result['fault_map'] if r['contact'] == contact]
        for line, fault in zip(axes, shown, strict=True):
            _fault_row(line, fault, contact, [r for r in rows if r['fault'] == fault.name])
        for axis, (_, _, title) in zip(axes[0], COLUMNS, strict=True):
            axis.annotate(title, (0.5, 1.0), (0, 22), xycoords='axes fraction', ha='center',
                          textcoords='offset points', fontweight='bold', fontsize=9)
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles[::-1], labels[::-1], loc='outside upper center', ncols=4,
                      frameon=False, fontsize=10)
        return figure
    return make


def _fault_row(axes, fault, contact, rows):
    places = np.arange(len(fault.levels))
    for axis, (key, scale, _) in zip(axes, COLUMNS, strict=True):
        for method, (colour, marker, width, order) in STYLES.items():
            if contact == 'line' and method == 'compensated':
                continue  # nothing to iterate: the same as the moments
            own = {r['level']: r[key] for r in rows if r['method'] == method}
            values = [np.nan if own[x] is None else scale * own[x] for x in fault.levels]
            name = 'moments (corrected)' if contact == 'line' and method == 'moments' else method
            axis.plot(places, values, color=colour, marker=marker, lw=width, ms=3.2, label=name,
                      zorder=order, clip_on=False)
        axis.set_xticks(places, [f'{level:g}' for level in fault.levels], fontsize=7)
        axis.tick_params(axis='y', labelsize=7)
        axis.grid(alpha=0.25)
        axis.set_xlim(-0.3, len(places) - 0.7)
        if key.startswith('rms'):
            axis.set_yscale('log')
            axis.set_ylim(*LIMITS[contact][COLUMNS.index((key, scale, _))])
        else:
            axis.set_ylim(-4, 104)
            axis.set_yticks([0, 50, 100])
    axes[0].set_title(f'{fault.name[0].upper()}{fault.name[1:]}: {fault.axis}', loc='left',
                      fontsize=8.5, pad=4)


def confusion(result):
    """Answers for every scene, at three strengths of noise."""
    rows = result['confusion']
    levels = list(dict.fromkeys(r['decibels'] for r in rows))
    scenes = list(dict.fromkeys(r['scene'] for r in rows))
    figure, axes = plt.subplots(1, len(levels), figsize=(10.5, 4.4), layout='constrained',
                                sharey=True)
    for axis, level in zip(axes, levels, strict=True):
        own = {r['scene']: r['answers'] for r in rows if r['decibels'] == level}
        grid = 100.0 * np.array([[own[scene][answer] for answer in ANSWERS] for scene in scenes])
        axis.imshow(grid, cmap='Blues', vmin=0, vmax=130, aspect='auto')
        for (i, j), value in np.ndenumerate(grid):
            if value > 0.0:
                text = f'{value:.0f}' if value >= 9.95 or value == round(value) else f'{value:.1f}'
                axis.text(j, i, text, ha='center', va='center', fontsize=8,
                          color='white' if value > 75 else 'black')
        for i in (0.5, 2.5, 4.5):
            axis.axhline(i, color='#888888', lw=0.8)
        for j in (0.5, 2.5, 4.5, 5.5):
            axis.axvline(j, color='#888888', lw=0.8)
        axis.set_xticks(range(len(ANSWERS)), ANSWERS, rotation=45, ha='right')
        axis.set_yticks(range(len(scenes)), scenes)
        axis.tick_params(length=0)
        axis.spines[:].set_visible(False)
        axis.set_title(f'{level:.0f} dB')
    axes[0].set_ylabel('what touched')
    axes[1].set_xlabel('what the estimator says [% of frames]')
    return figure
