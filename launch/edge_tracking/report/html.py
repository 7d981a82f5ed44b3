"""One self-contained HTML page, with pictures; nothing is loaded from outside."""
import base64
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from tactile_simulation.metrics import shown
from tactile_simulation.plot import png

_CSS = """
:root { color-scheme: light; }
body { margin: 0 auto; max-width: 62rem; padding: 1rem 1.1rem 3rem; background: #fff;
  color: #22262b; font: 16px/1.5 system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif; }
h1 { font-size: 1.55rem; line-height: 1.25; margin: .6rem 0 .2rem; }
h2 { font-size: 1.15rem; margin: 2.2rem 0 .4rem; }
p { margin: .3rem 0 .8rem; max-width: 46rem; }
.verdict { display: inline-block; padding: .1rem .6rem; border-radius: .3rem; color: #fff;
  background: #3a8a4d; font-weight: 600; font-size: .95rem; }
.verdict.bad { background: #b8372b; }
.numbers { display: grid; grid-template-columns: repeat(auto-fill, minmax(9.5rem, 1fr));
  gap: .5rem; margin: 1rem 0 0; padding: 0; }
.numbers div { border: 1px solid #dfe2e7; border-radius: .4rem; padding: .45rem .7rem; }
.numbers dt { font-size: .82rem; color: #555a61; }
.numbers dd { margin: 0; font-size: 1.2rem; font-weight: 600; white-space: nowrap; }
figure { margin: .4rem 0 0; }
img { display: block; width: 100%; height: auto; }
.picture { overflow-x: auto; }
.picture img { min-width: 34rem; }
.narrow { max-width: 44rem; }
figcaption, footer { font-size: .87rem; color: #555a61; }
@media print { .picture img { min-width: 0; } }
"""


class Section(NamedTuple):
    """A part of a page; `kind` is the class of its style."""

    heading: str
    figure: Figure
    caption: str
    kind: str = ''


class Verdict(NamedTuple):
    """What a page says first, and whether it is good."""

    text: str
    good: bool


def listed(summary: Mapping[str, Any], *keys: str) -> str:
    """Text with what a summary knows of some metrics."""
    return ', '.join(f'{name} {value} {unit}'.rstrip() for name, value, unit in shown(
        {key: summary.get(key) for key in keys}))


def of_this_run(summary: Mapping[str, Any], *keys: str) -> str:
    """Sentence with what a summary knows of the metrics of a picture."""
    return f' This run: {listed(summary, *keys) or "none of its numbers is known"}.'


def write_page(path, title: str, verdict: Verdict, lead: str, footer: str,
               rows: Iterable[tuple[str, str, str]], sections: Iterable[Section]) -> None:
    """Write a page; the rows are of `shown`."""
    numbers = ''.join(
        f'<div><dt>{escape(name[0].upper() + name[1:])}</dt>'
        f'<dd>{escape(f"{value} {unit}".strip())}</dd></div>' for name, value, unit in rows)
    parts = []
    for heading, figure, caption, kind in sections:
        data = base64.b64encode(png(figure)).decode('ascii')
        parts.append(
            f'<h2>{escape(heading)}</h2>\n<figure class="{kind}"><div class="picture">'
            f'<img alt="{escape(heading)}" src="data:image/png;base64,{data}"></div>'
            f'<figcaption><p>{escape(caption)}</p></figcaption></figure>')
    Path(path).write_text(
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>{escape(title)}</title><style>{_CSS}</style></head><body>\n'
        f'<h1>{escape(title)}</h1>\n'
        f'<p><span class="verdict{"" if verdict.good else " bad"}">{escape(verdict.text)}'
        '</span></p>\n'
        f'<p>{escape(lead)}</p>\n<dl class="numbers">{numbers}</dl>\n'
        + '\n'.join(parts) + f'\n<footer><p>{escape(footer)}</p></footer>\n</body></html>\n',
        encoding='utf-8')
