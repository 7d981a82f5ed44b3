"""What `from PACKAGE import NAME` gives, and the examples of how it is used."""
import ast
import doctest
from importlib import import_module
from pathlib import Path

import pytest

PACKAGES = ('tactile_sensing', 'tactile_shape', 'tactile_servo', 'tactile_simulation')


@pytest.mark.parametrize('package', PACKAGES)
def test_public_names(package):
    module = import_module(package)
    assert module.__all__ == dir(module) and len(module.__all__) > 5
    for name in module.__all__:
        found = getattr(module, name)
        assert getattr(found, '__module__', package).split('.')[0] == package
    with pytest.raises(AttributeError, match=f"'{package}' has no attribute 'nothing'"):
        module.__getattr__('nothing')


@pytest.mark.parametrize('package', PACKAGES)
def test_examples(package, monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[1])  # where the shipped scenes are
    module = import_module(package)
    failed, tried = doctest.testmod(module)
    assert not failed
    assert tried or '>>>' not in module.__doc__


def test_a_class_name_has_one_meaning():
    """But the reasons of contacts and of goals."""
    places = {}
    for package in (*PACKAGES, 'tactile_common', 'edge_tracking'):
        for path in Path(import_module(package).__file__).parent.rglob('*.py'):
            for node in ast.walk(ast.parse(path.read_text('utf-8'))):
                if isinstance(node, ast.ClassDef):
                    places.setdefault(node.name, []).append(path)
    assert {name for name, paths in places.items() if len(paths) > 1} == {'Reason'}
