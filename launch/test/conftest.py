"""Fixtures: a run that was made up, its scene and its bag; made once, tests change copies."""

import pytest
from recorded_run import straight_scene, TOPICS, write_bag

from edge_tracking.recording.run import read_run


@pytest.fixture(scope='session')
def scene():
    return straight_scene()


@pytest.fixture(scope='session')
def bag(tmp_path_factory):
    return write_bag(tmp_path_factory.mktemp('bags') / 'run')


@pytest.fixture(scope='session')
def run(bag):
    return read_run(bag)


@pytest.fixture(scope='session')
def empty(tmp_path_factory):
    """Run of which only the diagnostics were recorded."""
    return read_run(write_bag(
        tmp_path_factory.mktemp('bags') / 'empty', topics=TOPICS[6:7]))
