"""Files that the package ships: the robot, parameters."""
from pathlib import Path

from ament_index_python.packages import get_package_share_directory


def share(*parts):
    """Path of a file in the package's share folder."""
    return Path(get_package_share_directory('edge_tracking'), *parts)
