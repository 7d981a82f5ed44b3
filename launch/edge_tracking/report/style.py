"""How pictures look: every axis has a unit, and what can be labelled directly is."""
from io import BytesIO

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
import numpy as np

BLUE, ORANGE, GREY, INK = '#1f5fa8', '#d4691e', '#7a808a', '#22262b'
EDGE_COLOUR = '#c9cdd4'
ESTIMATE_COLOUR = '#10a4b8'  # on pressures
IN_A_ROW = 4  # pictures


def png(figure) -> bytes:
    """Return a figure as PNG."""
    buffer = BytesIO()
    figure.savefig(buffer, format='png', facecolor='white')
    return buffer.getvalue()


def new_figure(width, height):
    """Return an empty figure of a size in inches."""
    figure = Figure(figsize=(width, height), dpi=160, layout='constrained')
    FigureCanvasAgg(figure)
    return figure


def label(axes, xlabel='', ylabel='', title=''):
    """Label axes and give them the common look."""
    axes.set_xlabel(xlabel, fontsize=10, color=INK)
    axes.set_ylabel(ylabel, fontsize=10, color=INK)
    axes.tick_params(labelsize=9, colors='#4b5058')
    axes.set_title(title, fontsize=11, loc='left', color=INK)
    axes.spines[['top', 'right']].set_visible(False)
    axes.spines[['left', 'bottom']].set_color('#b8bcc4')
    axes.grid(color='#e6e8ec', linewidth=0.7)
    axes.set_axisbelow(True)


def note(axes, x, y, text, colour=INK, **options):
    """Write a text on a pale ground at a place of the data."""
    options = {'ha': 'left', 'va': 'center', **options}
    axes.annotate(text, (x, y), fontsize=9.5, color=colour, bbox={
        'facecolor': 'white', 'edgecolor': 'none', 'pad': 1.0, 'alpha': 0.8}, **options)


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


def colour_bar(figure, shown, axes, text, **options):
    """Add the bar of the colours of what is shown."""
    bar = figure.colorbar(shown, ax=axes, pad=0.02, **options)
    bar.set_label(text, fontsize=10)
    bar.ax.tick_params(labelsize=9)
    bar.outline.set_visible(False)
