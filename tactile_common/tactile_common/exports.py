"""Public names of a package, imported only on first use, because numba is slow to import."""
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def exported(package: str, modules: Mapping[str, str]) -> tuple[
        list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """
    Return `__all__`, `__getattr__` and `__dir__` (PEP 562) of a package.

    Parameters
    ----------
    package : str
        `__name__` of the package.
    modules : dict
        For each module the names that it provides, separated by spaces: ``{'contact.estimator':
        'ContactEstimator EstimatorConfig'}``.
    """
    home = {name: f'{package}.{module}' for module, names in modules.items()
            for name in names.split()}

    def find(name: str) -> Any:
        if name not in home:
            raise AttributeError(f'module {package!r} has no attribute {name!r}')
        return getattr(import_module(home[name]), name)

    return sorted(home), find, lambda: sorted(home)
