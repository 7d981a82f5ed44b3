"""Documents: links lead somewhere, made pages are as made, examples run."""
from pathlib import Path
import re
from urllib.parse import unquote

import pytest

from docs.generate import notebook_page, PAGES, REMEDIES
from edge_tracking.parameters import NODES, parameters_of
from tactile_sensing.types.contact import Reason
from tactile_servo.laws.registry import LAWS
from tactile_servo.reasons import ReasonCode

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / 'docs'
PAGES_OF_PEOPLE = sorted({*ROOT.glob('*.md'), *DOCS.glob('*.md'), *ROOT.glob('*/README.md')})


def prose(text):
    """Text without its blocks of code, and without code in lines."""
    return re.sub(r'`[^`\n]*`', '', re.sub(r'^ *```.*?^ *```$', '', text, flags=re.M | re.S))


def anchors(text):
    """Anchors of the headings, as GitHub and the site make them."""
    heads = re.findall(r'^#+ (.+)$', re.sub(r'^ *```.*?^ *```$', '', text, flags=re.M | re.S),
                       re.M)
    found = set()
    for head in heads:
        plain = name = re.sub(r'[^\w\- ]', '', head.lower()).replace(' ', '-')
        for number in range(1, len(heads)):
            if name not in found:
                break
            name = f'{plain}-{number}'  # of a second heading of that text
        found.add(name)
    return found


def dead_links(path, text):
    """Relative links and anchors of a page that lead nowhere."""
    found = []
    for link in re.findall(r'\]\(([^)\s]+)\)', prose(text)):
        if re.match(r'\w+:', link):
            continue
        name, _, anchor = unquote(link).partition('#')
        target = (path.parent / name) if name else path
        if name and not target.exists():
            found.append(link)
        elif anchor and anchor not in anchors(
                text if not name else target.read_text('utf-8')):
            found.append(link)
    return found


@pytest.mark.parametrize('path', PAGES_OF_PEOPLE, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_and_anchors(path):
    assert dead_links(path, path.read_text('utf-8')) == []


def test_dead_links_are_found():
    text = '# A b: c\n[x](#a-b-c) [y](#no) [z](nothing.md) `[](code.md)`\n```\n[q](no.md)\n```\n'
    assert dead_links(DOCS / 'page.md', text) == ['#no', 'nothing.md']


def test_every_page_is_in_the_navigation():
    listed = re.findall(r'^(\w+)$', (DOCS / 'index.md').read_text('utf-8'), re.M)
    assert sorted([*listed, 'index']) == sorted(path.stem for path in DOCS.glob('*.md'))


@pytest.mark.parametrize('name', sorted(PAGES.keys() - {'notebook.md'}))
def test_made_pages_are_as_made(name):
    assert (DOCS / name).read_text('utf-8') == PAGES[name](), 'run ./ws docs'


def test_notebook_runs_and_prints_what_the_page_says(monkeypatch):
    monkeypatch.chdir(ROOT)
    page, made = (DOCS / 'notebook.md').read_text('utf-8'), notebook_page(save=False)
    # Counts may differ by what changes elsewhere in servo and estimator; what is claimed may not.
    assert re.sub(r'\d+', '0', page) == re.sub(r'\d+', '0', made), 'run ./ws docs'
    assert 'within 0.1 mm of the true edge: True' in made
    assert 90 < int(re.search(r'(\d+) % of \d+ estimates lie in their ellipse', made)[1]) <= 100


SUFFIXES = ('npy', 'npz', 'ply', 'yaml')  # of files, not of parameters


def test_every_reason_has_a_remedy():
    """From 200 on something is to be done: holds, ends that were not met, refusals."""
    assert {code.name for code in ReasonCode if code >= 200} <= REMEDIES['servo'].keys()
    assert REMEDIES['servo'].keys() <= {code.name for code in ReasonCode}
    assert {reason.name for reason in Reason} <= REMEDIES['contact'].keys()
    for part in REMEDIES.values():
        assert all(cause and remedy for cause, remedy in part.values())


@pytest.mark.parametrize('path', PAGES_OF_PEOPLE, ids=lambda path: str(path.relative_to(ROOT)))
def test_parameters_that_a_page_names_exist(path):
    known = {parameter.name for node in NODES for law in LAWS
             for parameter in parameters_of(node, law)}
    groups = {name.partition('.')[0] for name in known if '.' in name}
    named = re.findall(r'`([a-z]+)\.([a-z_]+)`', path.read_text('utf-8'))
    wrong = [name for group, end in named if group in groups and end not in SUFFIXES
             for name in [f'{group}.{end}'] if name not in known]
    assert wrong == []


def examples():
    """Blocks of Python in the pages, by page and number."""
    for path in PAGES_OF_PEOPLE:
        blocks = re.findall(r'^```python\n(.*?)^```$', path.read_text('utf-8'), re.M | re.S)
        for number, block in enumerate(blocks):
            yield pytest.param(path, block, id=f'{path.stem}-{number}')


@pytest.mark.parametrize('path, block', examples())
def test_examples_run(path, block, capsys):
    exec(compile(block, str(path), 'exec'), {'__name__': 'example'})
    out = capsys.readouterr().out.strip()
    told = re.search(r'prints `([^`]+)`', path.read_text('utf-8').partition(block)[2])
    if told:
        assert out == told[1]


def test_the_tests_that_the_safety_page_names_are_there():
    page = (DOCS / 'safety.md').read_text('utf-8')
    named = re.findall(r'`(test_\w+\.py)::(test_\w+)`', page)
    assert len(named) > 10
    for file, name in named:
        path, = *ROOT.glob(f'*/test/{file}'), *ROOT.glob(f'test/{file}')
        assert f'def {name}(' in path.read_text('utf-8'), f'{file}::{name}'
