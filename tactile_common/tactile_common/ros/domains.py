"""Reserves a separate ROS domain, so that graphs that run at the same time stay separate."""
import os
import socket

DOMAINS = range(1, 101)
DISCOVERY = 7400, 7410  # DDS ports in domain 0: multicast, and the first participant's own
_held: list[socket.socket] = []


def hold_domain() -> int:
    """
    Reserve and return a ROS domain that no other process on this machine holds.

    The domain is held until the process ends. Domains with a listening participant are skipped,
    and so is ROS_DOMAIN_ID: a robot on another machine may use it.
    Raises a RuntimeError if none is left.
    """
    first = os.getpid() % len(DOMAINS)
    for domain in (*DOMAINS[first:], *DOMAINS[:first]):
        if str(domain) == os.environ.get('ROS_DOMAIN_ID'):
            continue
        # An abstract socket has no file. Its scope is the network namespace, like that of DDS,
        # and it disappears with the process.
        lock = socket.socket(socket.AF_UNIX)
        try:
            lock.bind(f'\0ros_domain_{domain}')
            for port in DISCOVERY:
                with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                    probe.bind(('', port + 250 * domain))
        except OSError:
            lock.close()
            continue
        _held.append(lock)
        return domain
    raise RuntimeError(f'all ROS domains from {DOMAINS[0]} to {DOMAINS[-1]} are taken')
