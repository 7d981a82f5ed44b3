"""Parts of the graph in processes of their own: they talk to the graph, and end with it."""


from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

from edge_tracking.graph import Graph, private_port
from edge_tracking.process_group import apart
from edge_tracking.recording.topics import short_name
from edge_tracking.resources import share
from tactile_common.ros.bag_reader import Bag
from tactile_msgs.msg import Contact
from tactile_simulation.scene import find_scene

ROBOT = share('urdf', 'puma260.urdf')
RECORDED = {'joint_states', 'image'}


def test_sensor_and_robot_are_heard_and_recorded_and_end_with_the_graph(tmp_path):
    seen = {}
    with private_port() as port:
        with apart('recorder', tmp_path / 'bag') as recorder, apart('shape') as shape, \
                apart('mocks', port, find_scene('straight'), ROBOT) as mocks, \
                apart('sensing', port) as sensing, \
                Graph() as graph:
            parts = recorder, shape, mocks, sensing
            listener = graph.add(Node, own={'node_name': 'listener'})
            for name, kind in (('/joint_states', JointState), ('/tactile/contact', Contact)):
                listener.create_subscription(
                    kind, name, lambda message, name=name: seen.setdefault(name, message),
                    qos_profile_sensor_data)
            recorded = set()
            listener.create_subscription(
                DiagnosticArray, '/diagnostics', lambda message: recorded.update(
                    topic for status in message.status for value in status.values
                    if value.key == 'heard' for topic in value.value.split()), 10)
            graph.spin(lambda: len(seen) == 2 and recorded >= RECORDED, 60.0)
            assert [part.poll() for part in parts] == [None] * 4
        assert [part.returncode for part in parts] == [0] * 4
        assert not port.is_symlink()
    assert len(seen['/joint_states'].position) == 6
    assert seen['/tactile/contact'].sensor
    with Bag(tmp_path / 'bag') as bag:
        heard = {short_name(row.topic) for row in bag.messages(bag.topics)}
    assert heard >= RECORDED


def test_a_part_that_cannot_start_says_why(capfd):
    with apart('sensing', '') as process:
        assert process.wait(60.0) == 2
    assert capfd.readouterr().err.strip() == (
        "sensing: parameter 'port' is empty, must name a serial port")
