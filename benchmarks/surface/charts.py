"""Pictures of the surface benchmark: the thesis' Figures 6.11 to 6.14."""
import matplotlib
import matplotlib.pyplot as plt
import numpy as np

matplotlib.use('Agg')


def draw(result, folder):
    """Write the picture into a folder."""
    figure, axes = plt.subplots(2, 2, figsize=(9, 6), layout='constrained')
    items = sorted(result['figures'], key=lambda item: item['figure'])
    for axis, item in zip(axes.flat, items, strict=True):
        points, errors = 1e3 * np.array(item['_points']), 1e6 * np.array(item['_errors'])
        shown = axis.scatter(points[:, 1], points[:, 2], c=errors, s=4, cmap='coolwarm',
                             vmin=-40, vmax=40)
        axis.set(title=f'Figure {item["figure"]}: {item["object"]}', xlabel='y [mm]',
                 ylabel='z [mm]', aspect='equal')
    figure.colorbar(shown, ax=axes, label='off the true surface [µm]')
    figure.savefig(folder / 'surface_figures.png', dpi=110)
    plt.close(figure)
