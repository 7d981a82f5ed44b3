"""
Self-contained web page and its parts; all texts of the parts are escaped.

Its content security policy forbids loading anything.
"""
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256
from html import escape
from importlib import resources
import json
from typing import Any

import numpy as np

# Colours from zero to the largest pressure, for levels 0 to 254; 255 is an invalid tactel.
COLOURS = ((251, 252, 191), (254, 194, 134), (251, 134, 96), (229, 80, 99), (181, 54, 121),
           (129, 37, 129), (79, 17, 123), (27, 16, 68), (0, 0, 3))
INVALID = 255


def levels(pressure: np.ndarray, top: float) -> np.ndarray:
    """Convert pressures to bytes: 0 to 254 from 0 to the top, `INVALID` for NaN."""
    shades = np.clip(pressure * (254.0 / max(top, 1e-30)), 0.0, 254.0)
    missing = np.isnan(shades)
    return np.where(missing, INVALID, np.rint(np.where(missing, 0.0, shades))).astype(np.uint8)


def packed(values: Any, dtype: str) -> str:
    """Return an array as text: base64 of little-endian values."""
    return b64encode(np.ascontiguousarray(values, dtype).tobytes()).decode('ascii')


def make_page(title: str, body: str, scripts: tuple[str, ...], *, kind: str = '',
              connect: str = "'none'") -> str:
    """
    Return the HTML of a page from a body in which all external text is escaped.

    `scripts` are names of scripts of this package, `kind` is the class of the body; `connect` is
    where the page may connect to, see `connect-src` of a content security policy.
    """
    read = [(resources.files(__package__) / name).read_text('utf-8')
            for name in ('page.css', *scripts)]
    hashes = [f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'" for text in read]
    policy = (f"default-src 'none'; img-src data:; style-src {hashes[0]}; script-src "
              f"{' '.join(hashes[1:])}; connect-src {connect}; base-uri 'none'; "
              "form-action 'none'")
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>{escape(title)}</title><style>{read[0]}</style></head>'
        f'<body class="{kind}" data-colours="{json.dumps(COLOURS)}">\n{body}\n'
        + ''.join(f'\n<script>{script}</script>' for script in read[1:]) + '\n</body></html>\n')


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
    """Return the HTML of charts, see `charts.chart`."""
    return ''.join(
        f'<canvas class="chart" role="img" aria-label="{escape(it["title"])}" '
        f'data-chart="{_json(it)}"></canvas>' for it in shown)


def player(data: Mapping[str, Any], canvases: Iterable[str]) -> str:
    """Return the HTML of a player of data, see `charts.player`, with canvases by description."""
    return f'<div class="player" data-run="{_json(data)}">' + ''.join(
        f'<canvas role="img" aria-label="{escape(what)}"></canvas>' for what in canvases) + (
        '<p></p><div class="controls"><button type="button">play</button>'
        '<input type="range" min="0" value="0" aria-label="time"></div></div>')


def _json(data: Mapping[str, Any]) -> str:
    return escape(json.dumps(data, allow_nan=False))
