"""Node that survives errors of the middleware and reports them in its diagnostics."""
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
import platform
import shlex
import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import ParameterEvent
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.subscription import RCLError, Subscription

from tactile_common.ros.cdr import known

DIAGNOSTICS_PERIOD = 1.0  # s
# No warning of a missing input for this time: nodes start together, and some load kernels [s].
START_UP = 20.0
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PARTS = ('tactile_common', 'numpy', 'scipy', 'numba')  # versions are published


@cache
def _versions() -> str:
    versions = [f'Python {platform.python_version()}']
    for name in PARTS:
        with suppress(PackageNotFoundError):  # of a source tree
            versions.append(f'{name} {version(name)}')
    return ', '.join(versions)


class _SurvivingPublisher(Publisher):
    """Publisher that passes errors of rcl to `on_error`."""

    on_error: Any = None

    def publish(self, msg: Any) -> None:
        try:
            super().publish(msg)
        except RCLError as error:
            if self.on_error is None:
                raise
            self.on_error(error, self.topic)


class TactileNode(Node):
    """
    Node that counts messages that cannot be sent, and continues.

    The middleware occasionally refuses a message ("cannot publish data") while readers come and
    go; the next one is usually sent. `tactile_common.ros.runner.spin` passes other errors of rcl
    in callbacks, such as the answer of a service, to `count_error`.

    `diagnose` publishes on `/diagnostics`, where aggregators listen. A node with its own
    diagnostics overrides `_on_diagnose`, which is called every second of steady time.

    The topic `parameters` (latched) contains all parameters of the node, the command that started
    it, and the versions of its libraries. It is published after the start and after every change,
    so that recordings contain it.

    Attributes
    ----------
    texts : dict of str
        Contents of files, published in place of the parameters that name these files.
    steady : Clock
        Clock of timers that must run while simulated time is paused.
    errors : int
        Number of messages, answers and the like that could not be sent.
    """

    errors = 0
    _errors_told = 0

    def __init__(self, name: str, **kwargs: Any):
        super().__init__(name, **kwargs)
        self._begun = time.monotonic()
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(DIAGNOSTICS_PERIOD, lambda: self._on_diagnose(), clock=self.steady)
        self.texts: dict[str, str] = {}
        self._settings = self.create_publisher(ParameterEvent, 'parameters', LATCHED)
        self._begin = self.create_timer(0.0, self._on_begin, clock=self.steady)

    def _on_begin(self) -> None:
        """Publish all parameters, which are now declared, and again after every change."""
        self.destroy_timer(self._begin)
        self.add_post_set_parameters_callback(lambda _: self._tell_parameters())
        self._tell_parameters()

    def _tell_parameters(self) -> None:
        known = self.get_parameters_by_prefix('')
        for name, text in {**self.texts, 'versions': _versions(),
                           'command': shlex.join(sys.argv)}.items():
            known[name] = Parameter(name, value=text)
        self._settings.publish(ParameterEvent(
            stamp=self.get_clock().now().to_msg(), node=self.get_fully_qualified_name(),
            new_parameters=[parameter.to_parameter_msg() for parameter in known.values()]))

    @property
    def starting(self) -> bool:
        """True during the first `START_UP` seconds: a missing input then needs no warning."""
        return time.monotonic() - self._begun < START_UP

    def create_publisher(self, *arguments: Any, **kwargs: Any) -> Publisher:
        """Create a publisher that counts messages that cannot be sent."""
        publisher = super().create_publisher(
            *arguments, **{'publisher_class': _SurvivingPublisher, **kwargs})
        if isinstance(publisher, _SurvivingPublisher):
            publisher.on_error = self.count_error
        return publisher

    def create_subscription(self, msg_type: type, *arguments: Any, raw: bool = False,
                            **kwargs: Any) -> Subscription:
        """Create a subscription; the decoder of raw messages is made now, not at the first one."""
        if raw:
            known(msg_type)
        return super().create_subscription(msg_type, *arguments, raw=raw, **kwargs)

    def _warn(self, text: str) -> None:
        """Log a warning, at most one in five seconds."""
        self.get_logger().warning(text, throttle_duration_sec=5.0)

    def count_error(self, error: Exception, what: str = '') -> None:
        """Count and log an error of rcl; raise it again if the context is shut down."""
        if not self.context.ok():
            raise error
        self.errors += 1
        where = f' on {what}' if what else ''
        self.get_logger().warning(
            f'not sent{where} ({self.errors} so far): {error}', throttle_duration_sec=5.0)

    def diagnose(self, level: bytes, text: str, values: dict[str, Any] | None = None, *,
                 name: str = 'node', hardware_id: str = '') -> None:
        """Publish the node's state and its number of errors; new errors turn OK into a warning."""
        if self.errors > self._errors_told and level == DiagnosticStatus.OK:
            level, text = DiagnosticStatus.WARN, f'{text}; messages could not be sent'
        self._errors_told = self.errors
        values = {**(values or {}), 'send_errors': self.errors}
        message = DiagnosticArray(status=[DiagnosticStatus(
            level=level, name=f'{self.get_fully_qualified_name()}: {name}', message=text,
            hardware_id=hardware_id,
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()])])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)

    def _on_diagnose(self) -> None:
        self.diagnose(DiagnosticStatus.OK, 'running')
