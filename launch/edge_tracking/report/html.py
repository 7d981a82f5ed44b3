"""HTML page of recordings side by side, with charts, tables and players."""
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

from edge_tracking.web.page import make_page
from tactile_simulation.metrics import shown


class Table(NamedTuple):
    """Rows of texts with headings."""

    head: tuple[str, ...]
    rows: list[tuple[str, ...]]


class Player(NamedTuple):
    """Data for the script, and the canvases that it fills: image, path."""

    data: dict[str, Any]
    canvases: list[str]  # description of each


class Section(NamedTuple):
    """A part of a column; its content is a table, a player or charts, see `charts.py`."""

    heading: str
    content: Table | Player | list[dict[str, Any]]
    caption: str


class Badge(NamedTuple):
    """A short label at the top; `kind` is 'bad', 'plain' or empty."""

    text: str
    kind: str = ''


class Column(NamedTuple):
    """All that the page shows of one recording."""

    title: str
    badges: list[Badge]
    lead: str
    about: list[tuple[str, ...]]  # rows of two texts
    numbers: list[tuple[str, str, str]]  # rows of `shown`
    sections: list[Section]


def listed(summary: Mapping[str, Any], *keys: str) -> str:
    """Return a text with the known values of some metrics of a summary."""
    return ', '.join(f'{name} {value} {unit}'.rstrip() for name, value, unit in shown(
        {key: summary.get(key) for key in keys}))


def of_this_run(summary: Mapping[str, Any], *keys: str) -> str:
    """Return a sentence with the known values of the metrics of a section."""
    return f' This run: {listed(summary, *keys) or "none of its numbers is known"}.'


def write_page(path: str | Path, columns: Sequence[Column]) -> None:
    """Write a page."""
    data: dict[str, list[Any]] = {'players': [], 'charts': []}
    parts = [_beside(_head(column) for column in columns)]
    named = [{section.heading: section for section in column.sections} for column in columns]
    for heading in dict.fromkeys(name for of_one in named for name in of_one):
        parts.append(f'<h2>{escape(heading)}</h2>\n' + _beside(
            _figure(of_one[heading], data) if heading in of_one else '<p>Not recorded.</p>'
            for of_one in named))
    text = make_page(' \u2013 '.join(column.title for column in columns), '\n'.join(parts),
                     data, ('tactile.js', 'player.js', 'chart.js'),
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


def _figure(section: Section, data: dict[str, list[Any]]) -> str:
    """Return the HTML of a section; its data for the scripts are added to `data`."""
    content = section.content
    if isinstance(content, Table):
        inner = _table(content)
    elif isinstance(content, Player):
        data['players'].append(content.data)
        inner = (
            '<div class="player">' + ''.join(
                f'<canvas role="img" aria-label="{escape(what)}"></canvas>'
                for what in content.canvases)
            + '<p></p><div class="controls"><button type="button">play</button>'
            '<input type="range" min="0" value="0" aria-label="time"></div></div>')
    else:
        data['charts'] += content
        inner = ''.join(f'<canvas class="chart" role="img" aria-label="{escape(it["title"])}">'
                        '</canvas>' for it in content)
    return (f'<figure>{inner}<figcaption><p>{escape(section.caption)}</p></figcaption>'
            '</figure>')
