"""Who imports what in a source tree, read from the syntax; nothing is imported."""
import ast
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree


@dataclass(frozen=True)
class Import:
    """One imported module; `local` within a function, `typing` for annotations only."""

    target: str
    line: int
    local: bool = False
    typing: bool = False


@dataclass(frozen=True)
class Module:
    """A module of a package or a test file of it (then `test`)."""

    name: str
    path: Path
    package: str
    test: bool
    imports: tuple[Import, ...]

    def at(self, line: int) -> str:
        """Place for a message."""
        return f'{self.path}:{line}'


@dataclass
class Tree:
    """Modules by their names; dependencies declared in package.xml, by package and kind."""

    modules: dict[str, Module] = field(default_factory=dict)
    declared: dict[str, dict[str, set[str]]] = field(default_factory=dict)

    def own(self, target: str) -> str | None:
        """Name of the module of this tree that an import loads, None if it is of no package."""
        while target and target not in self.modules:
            target = target.rpartition('.')[0]
        return target or None

    def closure(self, name: str) -> Iterator[tuple[str, Import, Module]]:
        """
        Yield what importing a module loads: every import outside functions, and whose it is.

        The first item is the way to it, as text.
        """
        waiting, seen = [(name, name)], {name}
        while waiting:
            here, way = waiting.pop()
            module = self.modules[here]
            for item in module.imports:
                if item.local or item.typing:
                    continue
                yield way, item, module
                there = self.own(item.target)
                if there and there not in seen:
                    seen.add(there)
                    waiting.append((there, f'{way} -> {there}'))


def read_tree(root: Path, without_manifest: tuple[str, ...] = ('benchmarks',)) -> Tree:
    """
    Read all packages below a folder, and folders of modules that are no packages.

    A package's modules lie in the folder of its name beside package.xml, its tests in `test`
    or, if it has no such folder, beside package.xml as `test_*.py`; launch files count as its
    own.
    """
    tree = Tree()
    sources = []
    for manifest in sorted(root.glob('*/package.xml')):
        about = ElementTree.parse(manifest).getroot()
        package = about.findtext('name', '')
        kinds: dict[str, set[str]] = {}
        for element in about:
            if element.tag.endswith('depend'):
                kinds.setdefault(element.tag, set()).add((element.text or '').strip())
        tree.declared[package] = kinds
        folder = manifest.parent
        tests = folder / 'test' if (folder / 'test').is_dir() else folder
        sources += [(package, folder / package, False), (package, folder / 'launch', False)]
        sources += [(package, tests, True)]
    sources += [(name, root / name, False) for name in without_manifest]
    for package, folder, test in sources:
        for path in sorted(folder.glob('*.py') if test else folder.rglob('*.py')):
            if path.name == 'setup.py':
                continue
            inside = path.relative_to(folder).with_suffix('').parts
            inside = inside[:-1] if inside[-1] == '__init__' else inside
            prefix = (package, 'test') if test else (package,)
            name = '.'.join(prefix + inside)
            syntax = ast.parse(path.read_text('utf-8'))
            base = name if path.name == '__init__.py' else name.rpartition('.')[0]
            tree.modules[name] = Module(
                name, path, package, test, tuple(_imports(syntax, base)))
    return _with_submodules(tree)


def _imports(node: ast.AST, base: str, local=False, typing=False) -> Iterator[Import]:
    for child in ast.iter_child_nodes(node):
        inside = local or isinstance(
            child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda))
        only = typing or (isinstance(child, ast.If) and 'TYPE_CHECKING' in ast.dump(child.test))
        if isinstance(child, ast.Import):
            for alias in child.names:
                yield Import(alias.name, child.lineno, local, typing)
        elif isinstance(child, ast.ImportFrom):
            target = child.module or ''
            if child.level:
                above = base.split('.')[:len(base.split('.')) - child.level + 1]
                target = '.'.join([*above, *filter(None, [target])])
            for alias in child.names:  # cut to the module when all of them are known
                yield Import(f'{target}.{alias.name}', child.lineno, local, typing)
        elif (isinstance(child, ast.Call) and child.args
                and isinstance(child.args[0], ast.Constant)
                and isinstance(child.args[0].value, str)
                and ast.unparse(child.func).split('.')[-1] in ('import_module', '__import__')):
            yield Import(child.args[0].value, child.lineno, local, typing)
        yield from _imports(child, base, inside, only)


def _with_submodules(tree: Tree) -> Tree:
    """Cut `package.module.name` to the module where it is one of ours."""
    for name, module in tree.modules.items():
        imports = tuple(Import(tree.own(item.target) or item.target, item.line, item.local,
                               item.typing) for item in module.imports)
        tree.modules[name] = Module(name, module.path, module.package, module.test, imports)
    return tree


def cycles(edges: dict[str, set[str]]) -> list[list[str]]:
    """Return the strongly connected parts of a graph that have more than one node."""
    ways: dict[str, set[str]] = {}  # to what a node leads
    for node in edges:
        waiting, ways[node] = [node], set()
        while waiting:
            new = edges.get(waiting.pop(), set()) - ways[node]
            ways[node] |= new
            waiting += new
    rings = {frozenset({node} | {other for other in ways[node] if node in ways.get(other, ())})
             for node in edges}
    return sorted(sorted(ring) for ring in rings if len(ring) > 1)
