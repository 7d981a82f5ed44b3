"""Every executable answers --help and --version, at once and without a graph."""
from importlib import import_module
from pathlib import Path
import re
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
EXECUTABLES = {'compile_kernels': 'tactile_common.kernels', **dict(
    found for path in sorted(ROOT.glob('*/*/executables.py'))
    for found in re.findall(r"^(\w+) = executable\('([\w.]+)'", path.read_text('utf-8'), re.M))}


def test_all_are_found():
    assert len(EXECUTABLES) == 23


@pytest.mark.parametrize('option, begins', [('--help', 'usage: {}'), ('--version', '{} ')])
@pytest.mark.parametrize('name', EXECUTABLES)
def test_help_and_version(name, option, begins, monkeypatch, capsys):
    monkeypatch.setattr(sys, 'argv', [name, option])
    with pytest.raises(SystemExit) as ended:
        import_module(EXECUTABLES[name]).main()
    out, err = capsys.readouterr()
    assert ended.value.code == 0 and err == ''
    assert out.startswith(begins.format(name)) and 'None' not in out


@pytest.mark.parametrize('name', ['driver', 'compile_kernels', 'simulate'])
def test_what_is_no_option_is_refused(name, monkeypatch, capsys):
    monkeypatch.setattr(sys, 'argv', [name, '--nonsense'])
    assert import_module(EXECUTABLES[name]).main() == 2
    assert capsys.readouterr().err.count('\n') == 1
