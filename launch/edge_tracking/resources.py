"""Files that the package installs: robot, parameters."""
from pathlib import Path

from ament_index_python.packages import get_package_share_directory


def share(*parts):
    """Return the path of a file in the package's share folder."""
    return Path(get_package_share_directory('edge_tracking'), *parts)
