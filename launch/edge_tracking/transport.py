"""Environment variables that restrict a graph to this host."""
from collections.abc import Mapping
import os

from edge_tracking.resources import share

RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
PROFILES = {'FASTDDS_DEFAULT_PROFILES_FILE': '{}/fastdds_local.xml',
            'CYCLONEDDS_URI': 'file://{}/cyclonedds_local.xml'}
_KNOWN = ('', 'rmw_fastrtps_cpp', 'rmw_fastrtps_dynamic_cpp', 'rmw_cyclonedds_cpp')
_CHOSEN = (RANGE, 'ROS_STATIC_PEERS', 'FASTRTPS_DEFAULT_PROFILES_FILE', *PROFILES)


def local_environment(environment: Mapping[str, str] = os.environ) -> dict[str, str]:
    """
    Return variables to add so that no other host can reach a socket of the graph.

    Returns none if the environment already restricts discovery; `ws` does the same in its shells.
    The discovery range LOCALHOST is not enough: such a node listens on all interfaces.
    """
    if any(environment.get(name) for name in _CHOSEN):
        return {}
    if environment.get('RMW_IMPLEMENTATION', '') not in _KNOWN:
        return {RANGE: 'LOCALHOST'}
    folder = share('config')
    # The profiles discover this host's nodes; LOCALHOST would add an unrestricted transport.
    return {RANGE: 'SYSTEM_DEFAULT',
            **{name: place.format(folder) for name, place in PROFILES.items()}}


def lease_environment(environment: Mapping[str, str] = os.environ) -> dict[str, str]:
    """
    Return variables to add so that a node that died silently is removed within two seconds.

    With the defaults of Fast DDS this takes 20 s; during this time a respawned node counts as a
    second publisher of its topics. Type lookup, which can crash a process, is off, as it is in
    the profile of `local_environment`. Returns none if the environment names its own profiles.
    """
    if any(environment.get(name) for name in ('FASTRTPS_DEFAULT_PROFILES_FILE', *PROFILES)):
        return {}
    return {'FASTDDS_DEFAULT_PROFILES_FILE': str(share('config', 'fastdds_lease.xml'))}
