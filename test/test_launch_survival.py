"""What a launch does when a node dies and when it is interrupted."""

import os
import re
import signal
import time

import pytest

WHY = 'launch_pytest is not installed: it comes with ROS 2, not as a wheel'
pytest.importorskip('launch_pytest', reason=WHY)
pytest.importorskip('launch_ros', reason=WHY)

# Only where launch is installed.
from tactile_tests.graph import bench  # noqa: E402, I100, I202
from tactile_tests.launching import DEADLINE, launched  # noqa: E402, I100

from tactile_msgs.msg import ServoReason  # noqa: E402, I100

NODES = ('driver', 'contact_estimator', 'shape_estimator', 'edge_servo', 'mock_sensor',
         'mock_robot')
BEFORE_ALL_IS_KNOWN = (ServoReason.SEVERAL_PUBLISHERS, ServoReason.NO_CONTACT)
BAD = r'Traceback|\[ERROR\]|\[FATAL\]|has died|KeyboardInterrupt|Exception'


def test_a_node_that_is_killed_ends_the_launch_by_name_and_the_goal_with_it():
    with launched() as it:
        with bench() as graph:
            graph.reach(0.0, DEADLINE)
        os.kill(it.pid('edge_servo'), signal.SIGKILL)
        assert it.end() == 1
        assert len(it.found('edge_servo has died .exit code -9., so the launch ends')) == 1
        assert it.found(r'track-\d+\]: process has finished cleanly')
        assert len(it.found('has died')) == 2  # and launch's own line


def test_every_node_may_die_where_it_is_started_again_and_a_goal_is_met_then():
    with launched('use_respawn:=true', 'start:=false') as it, bench() as graph:
        it.wait('frames arrive')
        for name in NODES:
            os.kill(it.pid(name), signal.SIGKILL)
            it.wait(rf'\[{name}-\d+\]: process started', 2)
        it.wait('tared, noise', 2)  # the driver keeps its tare when the sensor dies
        # Each node hears on its own of those that were killed and of those that came for them.
        # Until the servo has, a goal is refused; until the sensor has, nothing is touched.
        end, client = time.monotonic() + DEADLINE, None
        while client is None or (client.reason_code in BEFORE_ALL_IS_KNOWN
                                 and time.monotonic() < end):
            client = graph.track(length=0.01, wait=DEADLINE)
        assert client.success, client.reason
        it.interrupt()
        assert it.end() == 0
        assert len(it.found('has died')) == len(NODES)
        assert len(it.found('process has finished cleanly')) == len(NODES)


@pytest.mark.parametrize('moment', ['process started', 'frames arrive', ''],
                         ids=['imports', 'start', 'track'])
def test_ctrl_c_is_quiet_at_any_moment_and_twice(moment, tmp_path):
    with launched(TMPDIR=str(tmp_path)) as it:
        if moment:
            it.wait(moment)
        else:
            with bench() as graph:
                graph.reach(0.0, DEADLINE)
        it.prepared((*NODES, 'track'))
        begun = len(it.lines)  # a start that takes long is no matter of this test
        it.interrupt()
        it.wait('sending signal|finished cleanly')
        it.interrupt()
        it.end()  # of the second, launch may end after it is done
        # What a loaded machine delivers late is rejected, rightly.
        assert [line for line in it.lines[begun:]
                if re.search(BAD, line) and 'ends in the past' not in line] == []
        assert len(it.found('process has finished cleanly')) == len(NODES) + 1
    assert list(tmp_path.glob('tactile_*')) == []
