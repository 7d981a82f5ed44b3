"""Files that the package ships: scenes, the robot, parameters."""
from pathlib import Path

from ament_index_python.packages import get_package_share_directory

from tactile_common.errors import ConfigurationError


def share(*parts):
    """Path of a file in the package's share folder."""
    return Path(get_package_share_directory('edge_tracking'), *parts)


def scene_names():
    """Names of the shipped scenes."""
    folder = share('scenes')
    return sorted(path.relative_to(folder).with_suffix('').as_posix()
                  for path in folder.rglob('*.yaml'))


def find_scene(name):
    """Path of a scene: a file, or a shipped one by name; ConfigurationError if there is none."""
    path = Path(name)
    if path.suffix in ('.yaml', '.yml'):
        if path.is_file():
            return path
        raise ConfigurationError(f'scene {name!r}: no such file')
    if name in scene_names():
        return share('scenes', f'{name}.yaml')
    raise ConfigurationError(
        f'scene {name!r} is unknown; shipped are {", ".join(scene_names())}; '
        'or give the path of a .yaml file')
