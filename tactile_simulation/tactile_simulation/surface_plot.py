"""Picture of a run over a surface."""
import numpy as np

from tactile_simulation.surface_loop import SurfaceSimulation


def draw_surface(simulation: SurfaceSimulation, path) -> None:
    """Draw the contacts that were felt, from above and from the side, force and errors."""
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, 2, figsize=(10, 7), layout='constrained')
    contacts, truth = simulation.contacts, simulation.surface_truth()
    if len(contacts):
        points = 1e3 * (contacts - np.array(simulation.scene.top))
        errors = 1e6 * simulation.scene.surface.distance(contacts)
        for axis, (i, j) in zip(axes[0], ((0, 1), (1, 2)), strict=True):
            shown = axis.scatter(points[:, i], points[:, j], c=errors, s=3, cmap='coolwarm')
            axis.set(xlabel=f'{"xyz"[i]} [mm]', ylabel=f'{"xyz"[j]} [mm]', aspect='equal')
        figure.colorbar(shown, ax=axes[0, 1], label='off the true surface [µm]')
    way = 1e3 * truth.progress[truth.tracking]
    axes[1, 0].plot(way, truth.force[truth.tracking], 'C0')
    axes[1, 0].set(xlabel='way [mm]', ylabel='force [N]')
    axes[1, 1].plot(way, 1e3 * truth.place[truth.tracking], lw=1)
    axes[1, 1].set(xlabel='way [mm]', ylabel="contact from the pad's centre, x and y [mm]")
    for axis in axes[1]:
        axis.grid(alpha=0.3)
    figure.suptitle(simulation.scene.name)
    figure.savefig(path, dpi=120)
    pyplot.close(figure)
