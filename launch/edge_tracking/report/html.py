"""HTML of tables, numbers, charts and players; all texts are escaped."""
from collections.abc import Iterable, Mapping, Sequence
from html import escape
import json
from typing import Any


def table(rows: Iterable[Sequence[str]], head: Sequence[str] = ()) -> str:
    """Return the HTML of a table of texts."""
    heading = f'<tr>{"".join(f"<th>{escape(cell)}</th>" for cell in head)}</tr>' if head else ''
    body = ''.join(f'<tr>{"".join(f"<td>{escape(cell)}</td>" for cell in row)}</tr>'
                   for row in rows)
    return f'<div class="rows"><table>{heading}{body}</table></div>'


def numbers(rows: Iterable[tuple[str, str, str]]) -> str:
    """Return the HTML of numbers: name, value and unit."""
    return '<dl class="numbers">' + ''.join(
        f'<div><dt>{escape(name[0].upper() + name[1:])}</dt>'
        f'<dd>{escape(f"{value} {unit}".strip())}</dd></div>'
        for name, value, unit in rows) + '</dl>'


def charts(shown: Iterable[Mapping[str, Any]]) -> str:
    """Return the HTML of charts, see `charts.py`."""
    return ''.join(
        f'<canvas class="chart" role="img" aria-label="{escape(it["title"])}" '
        f'data-chart="{_json(it)}"></canvas>' for it in shown)


def player(data: Mapping[str, Any], canvases: Iterable[str]) -> str:
    """Return the HTML of a player: its data, see `player.py`, and descriptions of its canvases."""
    return f'<div class="player" data-run="{_json(data)}">' + ''.join(
        f'<canvas role="img" aria-label="{escape(what)}"></canvas>' for what in canvases) + (
        '<p></p><div class="controls"><button type="button">play</button>'
        '<input type="range" min="0" value="0" aria-label="time"></div></div>')


def _json(data: Mapping[str, Any]) -> str:
    return escape(json.dumps(data, allow_nan=False))


def figure(content: str, caption: str) -> str:
    """Return the HTML of content with its caption, a text."""
    return f'<figure>{content}<figcaption><p>{escape(caption)}</p></figcaption></figure>'
