"""How images of a tactile array look in a report."""
import numpy as np

from tactile_simulation.plot import colour_bar, INK, note

ESTIMATE_COLOUR = '#10a4b8'  # on pressures
IN_A_ROW = 4  # images


def tactels(figure, images, chosen, otherwise):
    """
    Draw pictures of the array in rows of up to `IN_A_ROW`, all with the same colours.

    Chosen are titles and indices; without any the text `otherwise` is written. Returns the axes.
    """
    if not chosen:
        axes = figure.subplots()
        axes.axis('off')
        note(axes, 0.02, 0.5, otherwise)
        return []
    columns = min(IN_A_ROW, len(chosen))
    grid = figure.subplots(
        -(-len(chosen) // columns), columns, sharex=True, sharey=True, squeeze=False)
    top = max(float(np.nanmax(images.frames[index], initial=0.0)) for _, index in chosen)
    panels, shown = grid.ravel().tolist(), None
    for axes, (title, index) in zip(panels, chosen, strict=False):
        shown = picture(axes, images, index, top)
        axes.set_title(title, fontsize=10.5, color=INK)
    for axes in panels[len(chosen):]:
        axes.axis('off')
    for axes in grid[-1]:
        axes.set_xlabel('x [mm]', fontsize=10)
    for axes in grid[:, 0]:
        axes.set_ylabel('y [mm]', fontsize=10)
    unit = 'kPa' if images.unit == 'Pa' else images.unit or '?'
    colour_bar(figure, shown, panels, f'pressure [{unit}]', shrink=0.8, aspect=18)
    return panels[:len(chosen)]


def mark_centre(axes, centre):
    """Mark a centre of pressure [m] in a picture."""
    axes.plot(*(1e3 * centre), '+', color=ESTIMATE_COLOUR, markersize=11, markeredgewidth=2.2)


def picture(axes, images, index, top):
    """Draw a picture of the array, its colours up to a pressure `top`."""
    array, scale = images.array, 1e-3 if images.unit == 'Pa' else 1.0
    x, y = 1e3 * array.half_width_x, 1e3 * array.half_width_y
    axes.set_facecolor('#dfe2e7')  # invalid tactels
    axes.tick_params(labelsize=9, colors='#4b5058')
    return axes.imshow(
        scale * np.ma.masked_invalid(images.frames[index]), origin='lower', cmap='magma_r',
        extent=(-x, x, -y, y), vmin=0.0, vmax=max(scale * top, 1e-9), interpolation='nearest')
