"""Mocks and recorder in a process of their own: they talk to the graph, and end with it."""

import os
import time

import numpy as np
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

from edge_tracking.beside import beside
from edge_tracking.composed import Graph, private_port
from edge_tracking.resources import find_scene, share
from edge_tracking.run_data import read_run
from tactile_msgs.msg import TactileImage
from tactile_sensing.nodes.driver import DriverNode


def test_sensor_and_robot_are_heard_and_recorded_and_end_with_the_graph(tmp_path):
    seen = {}
    domain = os.getpid() % 100 + 1
    with private_port() as port:
        with beside(port, find_scene('straight'), share('urdf', 'puma260.urdf'),
                    bag=tmp_path / 'bag', domain=domain) as process, \
                Graph(domain=domain) as graph:
            graph.add(DriverNode, port=str(port))
            listener = graph.add(Node, own={'node_name': 'listener'})
            for name, kind in (('/joint_states', JointState), ('/tactile/image', TactileImage)):
                listener.create_subscription(
                    kind, name, lambda message, name=name: seen.setdefault(name, message),
                    qos_profile_sensor_data)
            end = time.monotonic() + 30.0
            graph.spin(lambda: len(seen) == 2 or time.monotonic() > end)
            assert process.poll() is None
        assert process.returncode == 0
        assert not port.is_symlink()
    assert len(seen['/joint_states'].position) == 6
    assert np.shape(seen['/tactile/image'].layers[0].stress) == (256,)
    run = read_run(tmp_path / 'bag')
    assert len(run.joints.stamp_ns) and len(run.images.stamp_ns)
