"""Scenes by name or from a YAML file."""
import difflib
import os
from pathlib import Path
import re

from tactile_common.errors import ConfigurationError
from tactile_common.yaml_file import read_yaml
from tactile_simulation.scene_file import edge_scene, surface_scene
from tactile_simulation.world import Scene


def shipped_scenes() -> dict[str, Path]:
    """Return the files of the scenes of package edge_tracking by name; empty without it."""
    for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        folder = Path(prefix, 'share', 'edge_tracking', 'scenes')
        if folder.is_dir():
            return {path.relative_to(folder).with_suffix('').as_posix(): path
                    for path in sorted(folder.rglob('*.yaml'))}
    return {}


def describe_scenes() -> str:
    """Return a text with name and description of each installed scene, one per line."""
    lines = ['scenes, or the path of a .yaml file of your own:']
    for name, path in shipped_scenes().items():
        found = re.search(r'^description: *(.+)$', path.read_text('utf-8'), re.M)
        lines.append(f'  {name:24}{found[1] if found else ""}')
    return '\n'.join(lines)


def find_scene(name: str | os.PathLike) -> Path:
    """Return the file of an installed scene or path; ConfigurationError if there is none."""
    known = shipped_scenes()
    if str(name) in known:
        return known[str(name)]
    path = Path(name)
    if path.exists() or path.suffix in ('.yaml', '.yml'):
        return path
    near = difflib.get_close_matches(str(name), known, 1) or [
        one for one in known if one.endswith(f'/{name}')]
    hint = f'did you mean {near[0]}? ' if near else ''
    raise ConfigurationError(f'scene {str(name)!r} is unknown; {hint}shipped are '
                             f'{", ".join(known)}; or give the path of a .yaml file')


def load_scene(name: str | os.PathLike) -> Scene:
    """
    Read a scene, see `find_scene`.

    `launch/scenes/straight.yaml` explains the format of scenes with an edge,
    `launch/scenes/surfaces/sphere_126.yaml` that of scenes with a surface.

    Raises
    ------
    ConfigurationError
        The scene does not exist or cannot be read, or a key is missing, unknown or out of bounds.
    """
    path = find_scene(name)
    try:
        tree = read_yaml(path)
        of_surface = isinstance(tree, dict) and 'surface' in tree
        return (surface_scene if of_surface else edge_scene)(tree, path)
    except ConfigurationError as error:
        raise ConfigurationError(f'scene {path}: {error}') from error
