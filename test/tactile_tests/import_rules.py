"""Rules about imports, each a function of a Tree that returns what breaks it, a line each."""
from fnmatch import fnmatch

from tactile_tests.imports import cycles, Module, Tree

# Which of our packages may be imported; the tests of a package may also use what they declare.
ARROWS = {
    'tactile_common': set(),
    'tactile_sensing': {'tactile_common'},
    'tactile_shape': {'tactile_common', 'tactile_sensing'},
    'tactile_servo': {'tactile_common', 'tactile_sensing'},
    'tactile_simulation': {'tactile_common', 'tactile_sensing', 'tactile_servo', 'tactile_shape'},
}
ARROWS['edge_tracking'] = {*ARROWS}
ARROWS['benchmarks'] = {*ARROWS}  # one measures the graph
ARROWS['tactile_tests'] = {*ARROWS}
CORE = ('tactile_common', 'tactile_sensing', 'tactile_shape', 'tactile_servo',
        'tactile_simulation')
# Only these modules of the core know ROS.
WITH_ROS = ('*.conversions', '*.nodes', '*.nodes.*', 'tactile_common.ros', 'tactile_common.ros.*')
# These may be loaded within a function of any module: off-line, bags are one format of several.
BAGS = ('*.bag', '*.bag_reader', '*.bag_storage', '*.bag_writer', '*.observations')
ROS = ('rclpy', 'builtin_interfaces', 'rcl_interfaces', 'std_srvs', 'ament_index_python', 'launch',
       'launch_ros', '*_msgs')
# What only off-line work needs, and the modules that may load it when they are imported.
OFFLINE = ('matplotlib.*', 'mpl_toolkits.*', 'PIL.*', 'rosbags.rosbag2.*', 'skfem.*', 'pyvista.*')
OFFLINE_MODULES = ('*.plots', '*.plot', '*.charts', 'benchmarks.*', 'edge_tracking.report.*',
                   'edge_tracking.recording.*', *BAGS)
# Methods of the thesis lie in folders of this name; these modules alone reach into one: where the
# method is chosen by its name, and a law that is the thesis' itself.
THESIS = '*.thesis.*'
REACH_THESIS = ('tactile_sensing.contact.estimator', 'tactile_servo.laws.resolved_rate',
                'tactile_shape.shape_estimator')
# Distribution packages of what is imported, where the name differs.
KEYS = {'numpy': 'python3-numpy', 'scipy': 'python3-scipy', 'numba': 'python3-numba',
        'yaml': 'python3-yaml', 'serial': 'python3-serial', 'matplotlib': 'python3-matplotlib',
        'mpl_toolkits': 'python3-matplotlib', 'tqdm': 'python3-tqdm',
        'pytest': 'python3-pytest', 'hypothesis': 'python3-hypothesis',
        'pinocchio': 'pinocchio', 'rosbags': 'python3-rosbags-pip', 'PIL': 'python3-pil'}


def matches(name: str, patterns: tuple[str, ...]) -> bool:
    """Whether a name is one of those that the patterns mean."""
    return any(fnmatch(name, pattern) for pattern in patterns)


def top(target: str) -> str:
    """Package of an imported module."""
    return target.partition('.')[0]


def production(tree: Tree) -> list[Module]:
    """All modules but the tests."""
    return [module for module in tree.modules.values() if not module.test]


def wrong_arrows(tree: Tree) -> list[str]:
    """Imports of our packages against the table, within functions as well."""
    known = {module.package for module in tree.modules.values()}
    return [f'{module.at(item.line)}: {module.package} imports {item.target}'
            for module in production(tree) for item in module.imports
            if top(item.target) in known - {module.package} - ARROWS.get(module.package, set())]


def imported_programs(tree: Tree) -> list[str]:
    """Imports of a node or a command by others than nodes, commands, edge_tracking and tests."""
    programs = ('*.nodes.*', '*.cli.*')
    return [f'{module.at(item.line)}: {module.name} imports {item.target}'
            for module in production(tree) for item in module.imports
            if module.package not in ('edge_tracking', 'tactile_tests')
            and matches(item.target, programs) and top(item.target) in ARROWS
            and module.name.rpartition('.')[0] != item.target.rpartition('.')[0]]


def core_with_ros(tree: Tree) -> list[str]:
    """Core modules that load ROS when they are imported, or within their functions."""
    found = []
    for module in production(tree):
        if module.package not in CORE or matches(module.name, (*WITH_ROS, *BAGS)):
            continue
        found += [f'{way} -> {item.target} ({there.at(item.line)})'
                  for way, item, there in tree.closure(module.name)
                  if matches(top(item.target), ROS)]
        for item in module.imports:
            if item.local and not matches(item.target, BAGS):
                own = tree.own(item.target)
                ways = [item, *(one for _, one, _ in tree.closure(own))] if own else [item]
                found += [f'{module.at(item.line)}: within a function -> {one.target}'
                          for one in ways if matches(top(one.target), ROS)]
    return found


def offline_where_it_runs(tree: Tree) -> list[str]:
    """Plots and bags loaded by modules that are not made for them, or by a node."""
    found = [f'{module.at(item.line)}: {module.name} imports {item.target}'
             for module in production(tree) for item in module.imports
             if matches(f'{item.target}.', OFFLINE) and not item.local
             and not matches(module.name, OFFLINE_MODULES)]
    for module in production(tree):
        if matches(module.name, ('*.nodes.*',)):
            found += [f'{way} -> {item.target}' for way, item, _ in tree.closure(module.name)
                      if matches(f'{item.target}.', OFFLINE)]
    return found


def thesis_apart(tree: Tree) -> list[str]:
    """Imports of the thesis' methods by product code, within functions as well."""
    return [f'{module.at(item.line)}: {module.name} imports {item.target}'
            for module in production(tree) for item in module.imports
            if module.package not in ('benchmarks', 'tactile_tests')
            and matches(f'{item.target}.', (THESIS,)) and top(item.target) in ARROWS
            and not matches(f'{module.name}.', (THESIS, *(f'{it}.' for it in REACH_THESIS)))]


def import_cycles(tree: Tree) -> list[str]:
    """Circles of modules and of the rooms of a package, within functions as well."""
    modules: dict[str, set[str]] = {}
    rooms: dict[str, set[str]] = {}
    for module in production(tree):
        for item in module.imports:
            there = tree.own(item.target)
            if there and not item.typing and there != module.name:
                modules.setdefault(module.name, set()).add(there)
                one, other = room(module.name), room(there)
                if one != other and top(one) == top(other):
                    rooms.setdefault(one, set()).add(other)
    return [' <-> '.join(part) for graph in (modules, rooms) for part in cycles(graph)]


def room(name: str) -> str:
    """Subpackage of a module, or the module itself where it lies in none."""
    return '.'.join(name.split('.')[:2])


def manifests(tree: Tree) -> list[str]:
    """Differences between what packages import and what their package.xml declares."""
    found = []
    for package, kinds in tree.declared.items():
        used = {test: {KEYS.get(top(item.target), top(item.target))
                       for module in tree.modules.values()
                       if module.package == package and module.test == test
                       for item in module.imports} - {package} for test in (False, True)}
        if not used[False] and not used[True]:
            continue  # no Python in it
        checked = {*KEYS.values(), *tree.declared}
        for names in (*used.values(), *kinds.values()):
            checked |= {name for name in names if matches(name, ROS)}
        run = kinds.get('exec_depend', set()) | kinds.get('depend', set())
        test = kinds.get('test_depend', set())
        for text, names in (
                ('does not declare', used[False] - run),
                ('does not declare for its tests', used[True] - run - test),
                ('declares, but does not import', run - used[False]),
                ('declares for tests, which do not import', test - used[True]),
                ('declares twice', run & test)):
            found += [f'{package} {text} {name}' for name in sorted(names & checked)]
    edges = {package: set().union(*kinds.values()) & set(tree.declared)
             for package, kinds in tree.declared.items()}
    return found + [f'circle of packages: {" <-> ".join(part)}' for part in cycles(edges)]
