"""Domains of processes that run at the same time differ."""
import socket
import subprocess
import sys

import pytest

from tactile_common.ros import domains
from tactile_common.ros.domains import DOMAINS, hold_domain

CHILD = 'from tactile_common.ros.domains import hold_domain as h; print(h(), flush=True); input()'


def test_domains_are_each_held_once_until_the_process_ends():
    own = [hold_domain() for _ in range(3)]
    children = [subprocess.Popen([sys.executable, '-c', CHILD], stdin=subprocess.PIPE,
                                 stdout=subprocess.PIPE, text=True) for _ in range(3)]
    theirs = [int(child.stdout.readline()) for child in children]
    assert len({*own, *theirs}) == 6 and {*own, *theirs} <= set(DOMAINS)
    for child in children:
        child.communicate('\n')


@pytest.mark.parametrize('port', [7400, 7410])
def test_a_domain_with_a_participant_is_taken(monkeypatch, port):
    free = hold_domain()
    domains._held.pop().close()
    monkeypatch.setattr('os.getpid', lambda: DOMAINS.index(free))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as participant:
        participant.bind(('127.0.0.1', port + 250 * free))
        assert hold_domain() != free


def test_the_domain_of_the_environment_may_be_a_robots(monkeypatch):
    free = hold_domain() % len(DOMAINS)  # index of the next one
    monkeypatch.setattr('os.getpid', lambda: free)
    monkeypatch.setenv('ROS_DOMAIN_ID', str(DOMAINS[free]))
    assert hold_domain() != DOMAINS[free]
