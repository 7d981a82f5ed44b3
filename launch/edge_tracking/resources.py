"""Files that the package installs, and the default namespace."""
from pathlib import Path

from ament_index_python.packages import get_package_share_directory

NAMESPACE = 'tactile'  # of sensor, estimators and servo


def share(*parts: str) -> Path:
    """Return the path of a file in the package's share folder."""
    return Path(get_package_share_directory('edge_tracking'), *parts)
