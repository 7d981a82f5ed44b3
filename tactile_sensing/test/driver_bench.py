"""A driver, a listener and their executor, for tests."""
import threading
import time

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile

from tactile_common.ros import node, runner
from tactile_msgs.msg import SensorInfo, TactileImage
from tactile_sensing.nodes.driver import DriverNode

DEADLINE = 20.0  # s


class Bench:
    """A context of its own, with a driver and a listener."""

    def __init__(self, calibration, namespace='/', **parameters):
        self._period, node.DIAGNOSTICS_PERIOD = node.DIAGNOSTICS_PERIOD, 0.2
        self.context = Context()
        self.context.init()
        self.images, self.infos, self.reports = [], [], []
        self.node = Node('bench', context=self.context, namespace=namespace)
        self.node.create_subscription(
            TactileImage, 'image', self.images.append, qos_profile_sensor_data)
        self.node.create_subscription(
            SensorInfo, 'sensor_info', self.infos.append,
            QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        self.node.create_subscription(
            DiagnosticArray, '/diagnostics', lambda it: self.reports.append(it.status[0]), 10)
        parameters = {'tare_at_start': False, **parameters}
        self.driver = DriverNode(
            calibration=calibration, context=self.context, namespace=namespace,
            parameter_overrides=[Parameter(k, value=v) for k, v in parameters.items()])
        self.executor = runner.make_executor(self.context)
        for each in (self.driver, self.node):
            self.executor.add_node(each)

    def until(self, condition, what, act=lambda: None):
        """Run the executor, and repeat an action, until a condition holds."""
        end = time.monotonic() + DEADLINE
        while not condition():
            assert time.monotonic() < end, f'{what} did not come; {self.reports[-1:]}'
            act()
            self.executor.spin_once(timeout_sec=0.005)

    def shows(self, words, level=None):
        """Return whether the last diagnostic report contains these words and has this level."""
        return bool(self.reports) and words in self.reports[-1].message and level in (
            None, self.reports[-1].level)

    def value(self, key):
        return {it.key: it.value for it in self.reports[-1].values}[key] if self.reports else None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        node.DIAGNOSTICS_PERIOD = self._period
        self.node.destroy_node()
        self.driver.destroy_node()
        self.executor.shutdown()
        self.context.try_shutdown()
        assert not [it for it in threading.enumerate() if it.name == 'tactile driver']
