"""A ROS domain of one's own, so that graphs which run at the same time do not hear each other."""
import os
import socket

DOMAINS = range(1, 101)
_held: list[socket.socket] = []


def hold_domain() -> int:
    """
    Return a ROS domain that no other process on this machine has taken by this function.

    It is held until the process ends; domains in which something listens are passed over.
    RuntimeError if none is left.
    """
    first = os.getpid() % len(DOMAINS)
    for domain in (*DOMAINS[first:], *DOMAINS[:first]):
        # A name without a file: it reaches as far as DDS on this machine, the network namespace,
        # and goes with the process.
        lock = socket.socket(socket.AF_UNIX)
        try:
            lock.bind(f'\0ros_domain_{domain}')
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                probe.bind(('', 7400 + 250 * domain))  # where DDS looks for participants
        except OSError:
            lock.close()
            continue
        _held.append(lock)
        return domain
    raise RuntimeError(f'all ROS domains from {DOMAINS[0]} to {DOMAINS[-1]} are taken')
