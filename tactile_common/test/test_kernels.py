"""The folder of compiled kernels: it changes with their sources, and everybody uses it."""
import ast
from importlib.util import find_spec
import os
from pathlib import Path
import subprocess
import sys

import pytest

from tactile_common import kernels

KERNEL = ('from tactile_common.kernels import njit\n\n\n@njit(cache=True)\ndef twice(x):\n'
          '    return {}\n')
COMPILER = ('from made_package.core import twice\n\n\ndef compile_kernels():\n'
            "    print('twice', twice(4))\n")


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Package with a kernel, known to `kernels` alone."""
    package = tmp_path / 'made_package'
    package.mkdir()
    (package / '__init__.py').write_text('')
    (package / 'core.py').write_text(KERNEL.format('x + x'))
    (package / 'compile_kernels.py').write_text(COMPILER)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(kernels, 'PACKAGES', ('made_package', 'a_package_that_is_not_installed'))
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / 'cache'))
    return package


def test_the_folder_changes_with_the_kernels_and_with_nothing_else(made):
    before = kernels.cache_folder()
    assert before.parent == made.parent / 'cache' / 'tactile_kernels'
    (made / 'other.py').write_text('x = 1\n')
    assert kernels.cache_folder() == before
    (made / 'core.py').write_text(KERNEL.format('2 * x'))
    changed = kernels.cache_folder()
    assert changed != before
    (made / 'core.py').write_text(KERNEL.format('x + x'))  # the same again, but newer
    os.utime(made / 'core.py', (2e9, 2e9))
    again = kernels.cache_folder()
    assert again not in (before, changed)
    (made / 'deep').mkdir()
    (made / 'deep' / 'more.py').write_text(KERNEL.format('x'))
    assert kernels.cache_folder() not in (before, changed, again)


def test_without_the_variable_it_is_the_users_cache(monkeypatch, tmp_path):
    monkeypatch.delenv('NUMBA_CACHE_DIR')
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
    assert kernels.cache_folder().parent == tmp_path / 'tactile_kernels'


def run(made, program='sys.exit(kernels.main())'):
    """Run a program on the kernels of the made package in a process of its own; what it says."""
    code = ('import sys; from tactile_common import kernels; '
            "kernels.PACKAGES = ('made_package', 'none'); "
            f'kernels.config.CACHE_DIR = str(kernels.cache_folder())\n{program}')
    path = os.pathsep.join([str(made.parent), os.environ.get('PYTHONPATH', '')])
    done = subprocess.run([sys.executable, '-c', code], env={**os.environ, 'PYTHONPATH': path},
                          capture_output=True, text=True, check=True)
    return done.stdout, done.stderr


def test_kernels_of_another_users_workspace_are_copied(made, monkeypatch):
    run(made)
    shared = kernels.cache_folder()
    monkeypatch.setenv('XDG_CACHE_HOME', str(made.parent / 'own'))
    monkeypatch.setattr(os, 'access', lambda path, mode: made.parent / 'cache' not in (
        path, *path.parents))
    own = kernels.cache_folder()
    assert own == made.parent / 'own' / 'tactile_kernels' / shared.name
    shared.rename(shared.with_name('gone'))  # what is compiled now is not from there
    assert kernels.cache_folder() == own and os.listdir(own.parent) == [own.name]
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(made.parent / 'own'))
    out, _ = run(made, 'from made_package.core import twice; twice(4); print(*twice.stats[1:])')
    assert out == 'Counter({(int64,): 1}) Counter()\n'  # loaded once, never compiled


def test_without_a_folder_to_write_to_it_says_which_to_set(made, monkeypatch):
    monkeypatch.setattr(os, 'access', lambda path, mode: False)
    with pytest.raises(PermissionError, match='tactile_kernels.*set NUMBA_CACHE_DIR'):
        kernels.cache_folder()


def test_kernels_are_compiled_into_it_and_older_or_damaged_ones_go(made):
    old = kernels.cache_folder()
    (old / 'core').mkdir(parents=True)
    keep = old.parents[1] / 'not_ours'
    keep.mkdir()
    (made / 'core.py').write_text(KERNEL.format('x * 2'))
    out, errors = run(made)
    assert out == 'twice 8\n' and 'made_package: ' in errors
    (index,) = kernels.cache_folder().rglob('*.nbi')
    index.write_bytes(b'damaged')
    assert run(made)[0] == 'twice 8\n'
    assert keep.is_dir() and not old.exists()


def test_a_kernel_that_does_not_compile_is_an_error(made):
    (made / 'core.py').write_text(KERNEL.format('no_such_name + x'))
    with pytest.raises(subprocess.CalledProcessError) as error:
        run(made)
    assert 'no_such_name' in error.value.stderr


def test_a_terminal_reads_once_that_kernels_are_compiled(monkeypatch, capsys):
    monkeypatch.setattr(kernels, 'PACKAGES', (__name__.partition('.')[0],))
    monkeypatch.setattr(kernels._NOTICE, 'said', False)

    def compiled(terminal):
        monkeypatch.setattr(sys.stderr, 'isatty', lambda: terminal)
        for add in (1, 2):
            kernels.njit(lambda x, add=add: x + add)(1)
        return capsys.readouterr().err

    assert compiled(False) == ''
    assert compiled(True) == 'compiling kernels, once: this takes up to a minute\n'
    assert compiled(True) == ''


def takes_numba_itself(source):
    """Whether a module compiles by numba's own decorators, before the folder may be set."""
    return any(
        (isinstance(node, ast.Import) and any(n.name.split('.')[0] == 'numba' for n in node.names))
        or (isinstance(node, ast.ImportFrom) and (node.module or '').split('.')[0] == 'numba')
        for node in ast.walk(ast.parse(source)))


def test_every_kernel_takes_njit_from_here():
    assert takes_numba_itself('def f():\n    from numba import njit')
    assert takes_numba_itself('import numba.core')
    assert not takes_numba_itself(KERNEL.format('x'))
    for package in kernels.PACKAGES:
        for folder in find_spec(package).submodule_search_locations:
            for path in Path(folder).rglob('*.py'):
                if path != Path(kernels.__file__):
                    assert not takes_numba_itself(path.read_text('utf-8')), path
