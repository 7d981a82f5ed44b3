"""What a release needs of each package, and pins that stand in two places."""
from importlib import import_module
from pathlib import Path
import re
from xml.etree import ElementTree

import pytest
from tactile_tests.lock import LOCKS, pinned
import yaml

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = sorted(path.parent for path in ROOT.glob('*/package.xml'))


def manifest(folder):
    return ElementTree.parse(folder / 'package.xml').getroot()


@pytest.mark.parametrize('folder', PACKAGES, ids=lambda folder: folder.name)
def test_licence_and_changelog(folder):
    about = manifest(folder)
    licence = about.find('license')
    assert licence.text == 'Apache-2.0'
    text = (folder / licence.get('file')).read_text('utf-8')
    assert text == (ROOT / 'LICENSE').read_text('utf-8')
    title, heading = (folder / 'CHANGELOG.rst').read_text('utf-8').splitlines()[1:5:3]
    assert title == f'Changelog for package {about.findtext("name")}'
    assert heading == 'Forthcoming' or heading.startswith(about.findtext('version'))


def test_one_version_one_maintainer_and_urls_of_one_place():
    for value in (lambda about: about.findtext('version'),
                  lambda about: ElementTree.tostring(about.find('maintainer')).strip()):
        assert len({value(manifest(folder)) for folder in PACKAGES}) == 1
    assert len({tuple((url.get('type'), url.text) for url in manifest(folder).iter('url'))
                for folder in PACKAGES}) == 1
    assert [url.get('type') for url in manifest(PACKAGES[0]).iter('url')] == [
        'website', 'repository', 'bugtracker']


def test_pre_commit_has_the_pinned_versions():
    hooks = (ROOT / '.pre-commit-config.yaml').read_text('utf-8')
    lock = (ROOT / 'ws.lock').read_text('utf-8')
    assert re.search(r'ruff-pre-commit\n +rev: v(.+)', hooks)[1] == re.search(
        r'^ruff==(\S+)', lock, re.M)[1]
    assert re.search(r'mypy==([^,]+)', hooks)[1] == re.search(r'^mypy==(\S+)', lock, re.M)[1]


@pytest.mark.parametrize('name', LOCKS)
def test_every_pinned_file_has_its_hashes(name):
    text = (ROOT / name).read_text('utf-8')
    found = re.findall(r'^[\w.-]+==(?:[^\\\n]+ \\\n    --hash=sha256:[0-9a-f]{64})', text, re.M)
    assert len(found) == len([it for _, it in pinned(text) if it]) > 30


def modules_named(text):
    """Modules that a text names: a path from its package on, or the name of a neighbour."""
    folder = None
    for name in re.findall(r'`([\w/]+\.py)`', text):
        if '/' in name:
            folder = name.rpartition('/')[0]
        yield name if '/' in name else f'{folder}/{name}'


def lies_somewhere(name):
    return any((folder / name).is_file() for folder in (ROOT, *PACKAGES))


def test_files_that_architecture_and_contributing_name_exist():
    table = (ROOT / 'docs' / 'architecture.md').read_text('utf-8').partition('Where to look')[2]
    named = list(modules_named(table.partition('## Nodes')[0]))
    assert len(named) > 30
    assert [name for name in named if not lies_somewhere(name)] == []
    assert not lies_somewhere('tactile_sensing/half_space/no_such_module.py')
    text = (ROOT / 'CONTRIBUTING.md').read_text('utf-8')
    named = re.findall(r'`((?:tactile_\w+|launch|test)/[\w/.]+)`', text)
    assert len(named) > 6
    assert [name for name in named if not ('NAME' in name or (ROOT / name).exists())] == []


def executables(folder):
    """Names of the executables of a package, as its setup.py makes them."""
    setup = folder / 'setup.py'
    text = setup.read_text('utf-8') if setup.exists() else ''
    listed = re.search(r'for name in \(([^)]*)\)\]', text)
    return re.findall(r"'(\w+)'", listed[1]) if listed else re.findall(r"f'(\w+) = ", text)


@pytest.mark.parametrize('folder', PACKAGES, ids=lambda folder: folder.name)
def test_readme_names_executables_and_public_names(folder):
    name = manifest(folder).findtext('name')
    text = (folder / 'README.md').read_text('utf-8')
    assert text.startswith(f'# {name}\n') and 'Licence: Apache-2.0.' in text
    public = getattr(import_module(name), '__all__', [])
    wanted = {*executables(folder), *public}
    assert not wanted - {*re.findall(r'`(\w+)`', text)}
    assert bool(executables(folder)) == (name not in ('tactile_msgs', 'tactile_tests'))


def test_citation():
    about = yaml.safe_load((ROOT / 'CITATION.cff').read_text('utf-8'))
    # What the format asks for.
    assert {'cff-version', 'message', 'title', 'authors'} <= about.keys()
    assert about['version'] == manifest(PACKAGES[0]).findtext('version')
    assert about['license'] == manifest(PACKAGES[0]).findtext('license')
    assert about['authors'] == [{'name': manifest(PACKAGES[0]).findtext('maintainer')}]
