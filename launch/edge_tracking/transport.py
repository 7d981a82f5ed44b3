"""Keeping a graph to this host: which environment its processes need."""
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
    Variables to add so that no socket of a graph can be reached from another host.

    None where the environment says already who may be heard; `ws` does the same in its shells.
    The discovery range LOCALHOST alone does not do: such a node hears all interfaces.
    """
    if any(environment.get(name) for name in _CHOSEN):
        return {}
    if environment.get('RMW_IMPLEMENTATION', '') not in _KNOWN:
        return {RANGE: 'LOCALHOST'}
    folder = share('config')
    # The profiles find the others of this host; LOCALHOST would add a transport without bounds.
    return {RANGE: 'SYSTEM_DEFAULT',
            **{name: place.format(folder) for name, place in PROFILES.items()}}


def lease_environment(environment: Mapping[str, str] = os.environ) -> dict[str, str]:
    """
    Variables to add so that a node which died without a word is forgotten within two seconds.

    With Fast DDS as it comes it is 20 s, in which one that is respawned is the second publisher
    of its topics. None where the environment names profiles of its own.
    """
    if any(environment.get(name) for name in ('FASTRTPS_DEFAULT_PROFILES_FILE', *PROFILES)):
        return {}
    return {'FASTDDS_DEFAULT_PROFILES_FILE': str(share('config', 'fastdds_lease.xml'))}
