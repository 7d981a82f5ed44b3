"""Fixtures of the system tests."""

import pytest
from tactile_tests.graph import bench


@pytest.fixture
def running():
    """Give the whole graph on the straight edge, with nothing started yet."""
    with bench() as it:
        yield it.add_all()
