"""Fixtures of the system tests."""

import os

import pytest
from tactile_tests.graph import bench, half_rates

from edge_tracking.transport import local_environment

os.environ.update(local_environment())  # no robot of another host is moved, no other one heard


@pytest.fixture
def running(tmp_path):
    """Give the whole graph on the straight edge, with nothing started yet."""
    with bench(parameters=half_rates(tmp_path)) as it:
        yield it.add_all()
