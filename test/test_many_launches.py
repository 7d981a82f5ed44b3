"""Forty launches in a row, with goals, while readers come and go: no process dies."""
import pytest

WHY = 'launch_pytest is not installed: it comes with ROS 2, not as a wheel'
pytest.importorskip('launch_pytest', reason=WHY)
pytest.importorskip('launch_ros', reason=WHY)


@pytest.mark.long
def test_no_process_of_forty_launches_dies_while_readers_come_and_go():
    from tactile_tests import many_launches  # only where launch is installed

    assert many_launches.main(['--launches', '40', '--readers', '12']) == 0
