"""Domains of processes that run at the same time differ."""
import subprocess
import sys

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


def test_the_domain_of_the_environment_may_be_a_robots(monkeypatch):
    free = hold_domain() % len(DOMAINS)  # index of the next one
    monkeypatch.setattr('os.getpid', lambda: free)
    monkeypatch.setenv('ROS_DOMAIN_ID', str(DOMAINS[free]))
    assert hold_domain() != DOMAINS[free]
