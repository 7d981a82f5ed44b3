"""
What is no part of the loop, in a process of its own: mocks, shape estimator and recorder.

They take nothing of the interpreter that runs driver, contact estimator and servo.
"""

from contextlib import contextmanager
import json
import signal
import subprocess
import sys
import threading

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, WrenchStamped
from nav_msgs.msg import Path
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

from edge_tracking.bag import RecorderNode
from edge_tracking.composed import add_mocks, Graph
from tactile_msgs.msg import Contact, SensorInfo, ServoStatus, SurfacePatch, TactileImage
from tactile_shape.nodes.shape_estimator import ShapeEstimatorNode

PATIENCE = 10.0  # s for the process to end by itself, its recording written


def topics(namespace):
    """Every topic of the graph, with its type and the quality of service to listen with."""
    deep = QoSProfile(depth=100)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    sensor = QoSProfile(depth=100, reliability=qos_profile_sensor_data.reliability)
    own = [('image', TactileImage, sensor), ('sensor_info', SensorInfo, latched),
           ('contact', Contact, sensor), ('wrench', WrenchStamped, sensor),
           ('surface_patch', SurfacePatch, deep), ('contour', Path, latched),
           ('markers', MarkerArray, latched),
           ('servo_status', ServoStatus, deep), ('sensor_pose', PoseStamped, sensor),
           ('diagnostics', DiagnosticArray, deep)]
    return [(f'/{namespace}/{name}', kind, qos) for name, kind, qos in own] + [
        ('/joint_states', JointState, deep),
        ('/joint_trajectory_controller/joint_trajectory', JointTrajectory, deep)]


def record(graph, bag):
    """Add a recorder of everything to a graph."""
    return graph.add(RecorderNode, own={'path': bag, 'topics': topics(graph.namespace)})


@contextmanager
def beside(port, scene, robot, seed=0, *, bag=None, domain=None, namespace='tactile'):
    """
    Run the mocks and the shape estimator, and record, while in a `with` statement.

    Parameters
    ----------
    port, scene, robot : str or Path
        Of the pseudo-terminal's link, the scene's file and the URDF.
    seed : int
        Of the sensor's noise.
    bag : str or Path, optional
        Folder of a recording to make.
    domain : int, optional
        ROS domain; that of the environment if missing.
    namespace : str
        Of the sensor.

    Yields
    ------
    subprocess.Popen
        The process; it ends with this one, however this one ends.
    """
    options = {'mocks': [str(port), str(scene), str(robot), seed],
               'bag': None if bag is None else str(bag),
               'graph': {'domain': domain, 'namespace': namespace}}
    process = subprocess.Popen([sys.executable, '-m', __name__, json.dumps(options)],
                               stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.stdin.close()
        try:
            process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def main():
    """Run the nodes until the standard input ends."""
    options = json.loads(sys.argv[1])
    for number in (signal.SIGINT, signal.SIGTERM):  # meant for the graph, which ends this as well
        signal.signal(number, signal.SIG_IGN)
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    with Graph(**options['graph']) as graph:
        if options['bag']:
            record(graph, options['bag'])
        add_mocks(graph, *options['mocks'])
        graph.add(ShapeEstimatorNode)
        graph.spin(ended.is_set)
    return 0


if __name__ == '__main__':
    sys.exit(main())
