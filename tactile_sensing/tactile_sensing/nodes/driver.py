"""Driver of a tactile array: reads raw counts from a port or topic, publishes tactile images."""
from collections.abc import Callable, Iterator
from dataclasses import dataclass
import os
import threading
import time
from typing import Any

from ament_index_python.packages import get_package_share_directory
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from rclpy.lifecycle import LifecycleNodeMixin, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image
from std_msgs.msg import Float32MultiArray, UInt16MultiArray
from std_srvs.srv import Trigger

from tactile_common.config import bounded, documented, one_of
from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.ros.conversions import stamp_to_ns
from tactile_common.ros.node import LATCHED, TactileNode
from tactile_common.ros.parameters import declare_from
from tactile_common.ros.runner import run
from tactile_msgs.msg import SensorInfo as SensorInfoMsg
from tactile_msgs.msg import TactileImage as TactileImageMsg
from tactile_sensing.conversions import counts_from_msg, image_to_msg, sensor_info_to_msg
from tactile_sensing.devices.calibration import Calibration, load_calibration
from tactile_sensing.devices.image_converter import ImageConverter
from tactile_sensing.devices.registry import options_of, protocol_named, PROTOCOLS
from tactile_sensing.devices.stream import SensorStream, SILENCE
from tactile_sensing.devices.tare import Tare, TareRefusedError

# Longest wait for the reader at the end [s]; it checks `closed` after each read of about 20 ms.
_LAST_READ = 2.0
LOOK_PERIOD = 0.5  # time between checks for a publisher of a topic [s]
# Types of the topics that other drivers publish.
TYPES = {'sensor_msgs/msg/Image': Image, 'std_msgs/msg/Float32MultiArray': Float32MultiArray,
         'std_msgs/msg/UInt16MultiArray': UInt16MultiArray}
SUCCESS, FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE


@dataclass(frozen=True)
class DriverConfig:
    """Parameters of the driver node."""

    port: str = documented(
        '', 'Serial port of the sensor, for instance /dev/ttyUSB0, or '
        'usb:VENDOR:PRODUCT[:SERIAL NUMBER]; must be given unless `topic` is')
    topic: str = documented(
        '', 'Topic of raw images that another driver publishes, in place of a port')
    protocol: str = one_of(
        'flexitac', f'Byte protocol of the sensor: {", ".join(PROTOCOLS)}', PROTOCOLS)
    options: str = documented('', 'Options of the protocol, for instance `stamp=us checksum=true`')
    baud: int = bounded(0, "Line speed; 0 = the protocol's", 'bit/s', 0, 12_000_000)
    sensor: str = documented('flexitac', 'Name of the sensor')
    frame_id: str = documented('tactile_pad', 'Sensor frame')
    calibration: str = documented('', "Calibration file; empty = the protocol's, of this package")
    tare_at_start: bool = documented(True, 'Tare as soon as frames without load arrive')
    track_drift: bool = documented(False, 'Tare again and again while nothing touches the pad')
    autostart: bool = documented(
        True, 'Configure and activate at the start; else a lifecycle manager does')

    def __post_init__(self) -> None:
        if not self.port and not self.topic:
            raise ConfigurationError("parameter 'port' is empty, must name a serial port")


class ImageTopic:
    """
    Subscribe to a topic as soon as it is published with one of `TYPES`.

    `on_counts` is called with raw counts (rows, columns), stamp [ns] and sequence number. If the
    message has no stamp, the time of its arrival is used.
    """

    def __init__(self, node: Node, topic: str, shape: tuple[int, int],
                 on_counts: Callable[[np.ndarray, int, int], None]):
        self._node, self._shape, self._on_counts = node, shape, on_counts
        self.port = node.resolve_topic_name(topic)
        self._subscription: Any = None
        self._trouble = f'nobody publishes {self.port}'
        self.frames = 0
        self._last_at = time.monotonic()
        self._timer = node.create_timer(LOOK_PERIOD, self._look)
        self._look()

    def _look(self) -> None:
        kinds = {info.topic_type for info in self._node.get_publishers_info_by_topic(self.port)}
        known = sorted(kinds & TYPES.keys())
        if known:
            self._timer.cancel()
            self._trouble = ''
            self._subscription = self._node.create_subscription(
                TYPES[known[0]], self.port, self._on_message, qos_profile_sensor_data)
            self._node.get_logger().info(f'hearing {self.port}, {known[0]}')
        elif kinds:
            self._trouble = (f'{self.port} is of {", ".join(sorted(kinds))}, must be one of '
                             f'{", ".join(TYPES)}')

    def _on_message(self, message: Any) -> None:
        try:
            counts = counts_from_msg(message, self._shape)
        except TactileError as error:
            self._trouble = f'{self.port}: {error}'
            return
        self._trouble, self._last_at = '', time.monotonic()
        stamp_ns = stamp_to_ns(message.header.stamp) if hasattr(message, 'header') else 0
        self._on_counts(counts, stamp_ns or self._node.get_clock().now().nanoseconds, self.frames)
        self.frames += 1

    def trouble(self) -> str:
        """Return why no images arrive; empty if they do."""
        silent = time.monotonic() - self._last_at > SILENCE
        return self._trouble or f'{self.port} is silent' * silent

    def counters(self) -> dict[str, Any]:
        """Return the counters for diagnostics."""
        return {'frames': self.frames}

    def close(self) -> None:
        """Unsubscribe."""
        self._node.destroy_timer(self._timer)
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)


class DriverNode(LifecycleNodeMixin, TactileNode):
    """
    Publish the images of a tactile array; a lifecycle node that activates itself by default.

    While the node is active, a thread reads the port, decodes, converts and publishes, so that an
    image does not wait for the executor. Alternatively it subscribes to a topic. If the port is
    lost, it is reopened when it returns; the tare is kept. A given `calibration` replaces the
    file. Raises a ConfigurationError if the calibration or a parameter is wrong.
    """

    def __init__(self, calibration: Calibration | None = None, **kwargs: Any):
        self.source: Any = None  # a SensorStream or an ImageTopic while active
        self._thread: threading.Thread | None = None
        TactileNode.__init__(self, 'driver', **kwargs)
        LifecycleNodeMixin.__init__(self)
        self._config = declare_from(self, DriverConfig)
        self._given = calibration
        self._image_msg = TactileImageMsg()
        self._reported: tuple[float, dict] = (time.monotonic(), {})
        self._shown: tuple[bytes, str] | None = None
        self._unread = ''  # why the source cannot be opened, if it cannot
        self._images = self.create_publisher(TactileImageMsg, 'image', qos_profile_sensor_data)
        self._infos = self.create_publisher(SensorInfoMsg, 'sensor_info', LATCHED)
        self.create_service(Trigger, '~/tare', self._on_tare)
        self._configure()
        if self._config.autostart:
            self.trigger_configure()
            self.trigger_activate()

    def _configure(self) -> None:
        config, protocol = self._config, protocol_named(self._config.protocol)
        self._options = options_of(config.protocol, config.options)
        path = config.calibration
        if not path and (config.topic or not protocol.calibration) and self._given is None:
            raise ConfigurationError(
                f"parameter 'calibration' is empty: {config.topic or config.protocol} needs a "
                'file that says at least rows, columns, pitch and gain')
        calibration = self._given or load_calibration(path or os.path.join(
            get_package_share_directory('tactile_sensing'), 'config', protocol.calibration))
        protocol.decoder(*calibration.raw_shape, calibration.counts.dtype, **self._options)
        self._converter = ImageConverter(calibration, config.tare_at_start, config.track_drift)
        self._tared_at_ns = 0  # 0: not yet
        self._delay_ns = round(calibration.acquisition_delay * 1e9)

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        """Read the calibration."""
        try:
            self._configure()
        except ConfigurationError as error:
            self.get_logger().error(str(error))
            return FAILURE
        return SUCCESS

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        """Start to read the sensor and to publish."""
        self._publish_info()
        self._unread = ''
        try:
            self._open()
        except Exception as error:  # a protocol of another package may raise anything
            self._unread = (f'{self._config.topic or self._config.port} cannot be read: '
                            + ' '.join(str(error).split()))
            self.get_logger().error(self._unread)
            return FAILURE
        return SUCCESS

    def _open(self) -> None:
        calibration = self._converter.calibration
        if self._config.topic:
            self.source = ImageTopic(
                self, self._config.topic, calibration.raw_shape, self._on_counts)
            return
        self.source = SensorStream(
            self._config.port, self._config.protocol, calibration.raw_shape,
            kind=calibration.counts.dtype, rate=calibration.nominal_rate,
            baud=self._config.baud, options=self._options,
            now_ns=lambda: self.get_clock().now().nanoseconds, tell=self._on_port)
        # A daemon thread: if a call of the port hangs, the process can still exit.
        self._thread = threading.Thread(
            target=self._read_forever, args=(self.source,), name='tactile driver', daemon=True)
        self._thread.start()

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        """Close the port; abandon the reader thread if its port hangs."""
        if self._thread is None:
            if self.source is not None:
                self.source.close()
        else:
            self.source.closed.set()
            self._thread.join(_LAST_READ)
            if self._thread.is_alive():
                self.get_logger().warning(
                    f'{self._config.port} does not answer: its reader is left behind')
        self.source = self._thread = None
        return SUCCESS

    on_shutdown = on_deactivate

    def destroy_node(self) -> None:
        """Stop the reader, then destroy the node."""
        self.on_deactivate(None)
        super().destroy_node()

    def _read_forever(self, stream: SensorStream) -> None:
        """Read and publish until the stream is closed; runs in the reader thread."""
        try:
            while not stream.closed.is_set() and self.context.ok():
                for stamp_ns, sequence, counts in stream.read():
                    if stream.closed.is_set():
                        return
                    self._on_counts(counts, stamp_ns, sequence)
        except RuntimeError:  # from rcl
            if self.context.ok() and not stream.closed.is_set():
                raise
            # The context was shut down while publishing: end quietly.
        finally:
            stream.close()

    def _on_port(self, text: str, gone: bool) -> None:
        self._converter.forget()
        self._log(DiagnosticStatus.WARN if gone else DiagnosticStatus.OK, text)

    def _on_counts(self, counts: np.ndarray, arrival_ns: int, sequence: int) -> None:
        if counts.dtype.kind == 'f':
            counts = counts / self._converter.calibration.resolution
        image = self._converter.image(counts, max(arrival_ns - self._delay_ns, 0), sequence)
        image.frame_id, image.sensor = self._config.frame_id, self._config.sensor
        self._images.publish(image_to_msg(image, self._image_msg))
        if self._converter.due():
            first = self._converter.tare is None
            try:
                tare = self._converter.take_tare(anew=False)
            except TareRefusedError:
                return
            if first:
                self._on_tared(tare)

    def _on_tared(self, tare: Tare) -> None:
        self._tared_at_ns = self.get_clock().now().nanoseconds
        self._publish_info()
        self.get_logger().info(f'tared, noise {tare.noise_std:.2f} counts')

    def _publish_info(self) -> None:
        now_ns, tare = self.get_clock().now().nanoseconds, self._converter.tare
        self._infos.publish(sensor_info_to_msg(self._converter.calibration.sensor_info(
            self._config.sensor, self._config.frame_id, now_ns, tare, self._tared_at_ns)))

    def _on_tare(self, _: Any, response: Any) -> Any:
        # The recent images are used: waiting for new ones in a callback would block a
        # single-threaded executor.
        try:
            tare = self._converter.take_tare()
        except TareRefusedError as error:
            response.message = str(error)
            return response
        self._on_tared(tare)
        response.message, response.success = f'noise {tare.noise_std:.2f} counts', True
        return response

    def _on_diagnose(self) -> None:
        source, converter, now = self.source, self._converter, time.monotonic()
        counters = source.counters() if source is not None else {}
        (since, before), self._reported = self._reported, (now, counters)
        new = {name: value - before.get(name, 0) for name, value in counters.items()
               if isinstance(value, int)}
        level, text = next(item for item in self._states(new) if item[1])
        shown = level, text
        if self.starting and converter.tare is None:
            shown = DiagnosticStatus.OK, f'starting: {text}'
        # The loss of the port is not logged again.
        if shown != self._shown and not (counters.get('connections') and source.fault == text):
            self._log(*shown)
        self._shown = shown
        rate = max(new.get('frames', 0), 0) / (now - since)
        self.diagnose(level, text, {
            'rate': f'{rate:.1f}', **counters, 'saturated_tactels': converter.saturated,
            'dead_tactels': int((~converter.calibration.live).sum()),
            'tared': converter.tare is not None,
        }, name=self._config.sensor, hardware_id=self._config.port or self._config.topic)

    def _states(self, new: dict[str, int]) -> Iterator[tuple[bytes, str]]:
        """
        Yield levels and texts by priority; a state holds if its text is not empty.

        ERROR: no images arrive. WARN: the driver is not active, or images are missing or wrong;
        the servo continues, but the operator should check. OK: otherwise.
        """
        error, warn = DiagnosticStatus.ERROR, DiagnosticStatus.WARN
        converter, source = self._converter, self.source
        counts = converter.calibration.counts
        yield error, self._unread
        yield warn, '' if source is not None else 'not active'
        yield error, 'the reader has stopped' * (
            self._thread is not None and not self._thread.is_alive())
        yield error, source.trouble()
        yield warn, converter.impossible * (
            f'counts outside {counts.lowest} to {counts.highest} arrive, which `bits: '
            f'{counts.bits}` of the calibration excludes: set `bits` and `signed` there')
        converter.impossible = False
        yield warn, f'not tared: {converter.refusal}' if converter.tare is None else ''
        for name, reason in (
                ('thinned_frames', 'images come too fast: more than 6 times the nominal_rate of '
                 'the calibration'),
                ('stalled_frames', 'images were dropped: the pause in their bytes, or a slow '
                 'machine, leaves open when they were sent'),
                ('skipped_frames', 'images were dropped as they had waited: this machine is too '
                 'slow'),
                ('check_errors', 'damaged frames arrive: their checksum or form is wrong'),
                ('dropped_bytes', 'bytes were dropped')):
            yield warn, reason if new.get(name, 0) > 0 else ''
        yield DiagnosticStatus.OK, 'frames arrive'

    def _log(self, level: bytes, text: str) -> None:
        # One call per severity: the logger allows only one severity per source line.
        if level == DiagnosticStatus.ERROR:
            self.get_logger().error(text)
        elif level == DiagnosticStatus.WARN:
            self.get_logger().warning(text)
        else:
            self.get_logger().info(text)


def main(args: list[str] | None = None) -> int:
    """Run the driver."""
    return run(DriverNode, args)
