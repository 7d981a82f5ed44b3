"""Recordings side by side as one HTML page, with its figures, tables and players."""
import base64
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from edge_tracking.web.page import make_page
from tactile_simulation.metrics import shown
from tactile_simulation.plot import png


class Table(NamedTuple):
    """Rows of texts under their headings."""

    head: tuple[str, ...]
    rows: list[tuple[str, ...]]


class Player(NamedTuple):
    """Data for the script, and which canvases it fills: image, way."""

    data: dict[str, Any]
    canvases: list[str]  # what each shows


class Section(NamedTuple):
    """A part of a column; `kind` is the class of its style."""

    heading: str
    content: Figure | Table | Player
    caption: str
    kind: str = ''


class Badge(NamedTuple):
    """A word or two at the top; `kind` is 'bad', 'plain' or empty."""

    text: str
    kind: str = ''


class Column(NamedTuple):
    """All that the page says of one recording."""

    title: str
    badges: list[Badge]
    lead: str
    about: list[tuple[str, ...]]  # rows of two texts
    numbers: list[tuple[str, str, str]]  # rows of `shown`
    sections: list[Section]


def listed(summary: Mapping[str, Any], *keys: str) -> str:
    """Text with what a summary knows of some metrics."""
    return ', '.join(f'{name} {value} {unit}'.rstrip() for name, value, unit in shown(
        {key: summary.get(key) for key in keys}))


def of_this_run(summary: Mapping[str, Any], *keys: str) -> str:
    """Sentence with what a summary knows of the metrics of a picture."""
    return f' This run: {listed(summary, *keys) or "none of its numbers is known"}.'


def write_page(path: str | Path, columns: Sequence[Column]) -> None:
    """Write a page."""
    players: list[dict[str, Any]] = []
    parts = [_beside(_head(column) for column in columns)]
    named = [{section.heading: section for section in column.sections} for column in columns]
    for heading in dict.fromkeys(name for of_one in named for name in of_one):
        parts.append(f'<h2>{escape(heading)}</h2>\n' + _beside(
            _figure(of_one[heading], players) if heading in of_one else '<p>Not recorded.</p>'
            for of_one in named))
    text = make_page(' \u2013 '.join(column.title for column in columns), '\n'.join(parts),
                     {'players': players}, ('tactile.js', 'player.js'),
                     kind='two' if len(columns) > 1 else '')
    Path(path).write_text(text, 'utf-8')


def _beside(parts: Iterable[str]) -> str:
    return f'<div class="beside">{"".join(f"<div>{part}</div>" for part in parts)}</div>'


def _head(column: Column) -> str:
    badges = ''.join(f'<span class="badge {kind}">{escape(text)}</span>'
                     for text, kind in column.badges)
    numbers = ''.join(
        f'<div><dt>{escape(name[0].upper() + name[1:])}</dt>'
        f'<dd>{escape(f"{value} {unit}".strip())}</dd></div>'
        for name, value, unit in column.numbers)
    return (f'<h1>{escape(column.title)}</h1>\n<p>{badges}</p>\n<p>{escape(column.lead)}</p>\n'
            f'{_table(Table((), column.about))}\n<dl class="numbers">{numbers}</dl>')


def _table(table: Table) -> str:
    rows = [f'<tr>{"".join(f"<th>{escape(cell)}</th>" for cell in table.head)}</tr>'
            if table.head else '']
    rows += [f'<tr>{"".join(f"<td>{escape(cell)}</td>" for cell in row)}</tr>'
             for row in table.rows]
    return f'<div class="rows"><table>{"".join(rows)}</table></div>'


def _figure(section: Section, players: list[dict[str, Any]]) -> str:
    heading, content, caption, kind = section
    if isinstance(content, Table):
        inner = _table(content)
    elif isinstance(content, Player):
        players.append(content.data)
        inner = (
            '<div class="player">' + ''.join(
                f'<canvas role="img" aria-label="{escape(what)}"></canvas>'
                for what in content.canvases)
            + '<p></p><div class="controls"><button type="button">play</button>'
            '<input type="range" min="0" value="0" aria-label="time"></div></div>')
    else:
        data = base64.b64encode(png(content)).decode('ascii')
        inner = (f'<div class="picture"><img alt="{escape(heading)}" '
                 f'src="data:image/png;base64,{data}"></div>')
    return (f'<figure class="{kind}">{inner}<figcaption><p>{escape(caption)}</p></figcaption>'
            '</figure>')
