"""Driver of a tactile array on a serial port: bytes in, tactile images out."""
from collections import deque
from dataclasses import dataclass, field
import os
import threading
import time
from typing import NamedTuple

from ament_index_python.packages import get_package_share_directory
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile
from std_srvs.srv import Trigger

from tactile_common.config import bounded, one_of
from tactile_common.errors import ConfigurationError
from tactile_common.ros.node import TactileNode
from tactile_common.ros.parameters import declare_from
from tactile_common.ros.runner import run
from tactile_msgs.msg import SensorInfo as SensorInfoMsg
from tactile_msgs.msg import TactileImage as TactileImageMsg
from tactile_sensing.conversions import image_to_msg, sensor_info_to_msg
from tactile_sensing.devices.calibration_file import load_calibration
from tactile_sensing.devices.frame_clock import FrameClock
from tactile_sensing.devices.registry import protocol_named, PROTOCOLS
from tactile_sensing.devices.serial_port import SensorPort
from tactile_sensing.devices.tare import MIN_TARE_FRAMES, TareRefusedError
from tactile_sensing.types.image import TactileImage

# A stream without a byte or a frame for this long is reported [s].
_SILENCE = 1.0
# Longest wait for the reader at the end [s]; it looks up after each read of some 20 ms.
_LAST_READ = 2.0
MIN_BAUD = 1200
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@dataclass(frozen=True)
class DriverConfig:
    """Parameters of the driver node."""

    port: str = field(default='', metadata={
        'doc': 'Serial port of the sensor, for instance /dev/ttyUSB0; must be given'})
    protocol: str = one_of(
        'flexitac', f'Byte protocol of the sensor: {", ".join(PROTOCOLS)}', PROTOCOLS)
    baud: int = bounded(0, "Line speed; 0 = the protocol's", 'bit/s', 0, 12_000_000)
    sensor: str = field(default='flexitac', metadata={'doc': 'Name of the sensor'})
    frame_id: str = field(default='tactile_pad', metadata={'doc': 'Sensor frame'})
    calibration: str = field(default='', metadata={
        'doc': "Calibration file; empty = the protocol's, of this package"})
    tare_at_start: bool = field(default=True, metadata={
        'doc': 'Tare as soon as frames without load arrive'})
    tare_frames: int = bounded(50, 'Frames averaged by a tare', '', MIN_TARE_FRAMES, 10000)
    reconnect_period: float = bounded(
        0.1, 'Time between attempts to open the port', 's', 0.01, 60.0)

    def __post_init__(self):
        if not self.port:
            raise ConfigurationError("parameter 'port' is empty, must name a serial port")
        if 0 < self.baud < MIN_BAUD:
            raise ConfigurationError(
                f"parameter 'baud' is {self.baud}, must be 0 or at least {MIN_BAUD} bit/s")


class Report(NamedTuple):
    """Counts at the time of a report [s]."""

    at: float
    frames: int = 0
    dropped_bytes: int = 0
    stalled: int = 0
    thinned: int = 0


class DriverNode(TactileNode):
    """
    Publish the pictures of a tactile array.

    A thread reads the port, decodes, converts and publishes, so that a picture waits for nothing
    in the executor. The port may come and go; the tare is kept. A `calibration` that is given
    takes the place of the file; raises a ConfigurationError where it or a parameter is wrong. Many
    of its attributes are ROS entities, the others what the port's thread shares with the executor.
    """

    def __init__(self, calibration=None, **kwargs):
        self._stop = threading.Event()
        # Daemonic: a port that does not return from a call keeps its reader, not the process.
        self._thread = threading.Thread(
            target=self._read_forever, name='tactile driver', daemon=True)
        super().__init__('driver', **kwargs)
        self._config = declare_from(self, DriverConfig)
        protocol = protocol_named(self._config.protocol)
        self._baud = self._config.baud or protocol.baud_rate
        self._calibration = calibration or load_calibration(
            self._config.calibration or os.path.join(
                get_package_share_directory('tactile_sensing'), 'config', protocol.calibration))
        self._decoder = protocol.decoder(
            *self._calibration.raw_shape, self._calibration.counts.dtype)
        self._frame_size = self._calibration.live.size * self._calibration.counts.dtype.itemsize
        self._frames = FrameClock(self._decoder, self._calibration.nominal_rate)
        self._delay_ns = round(self._calibration.acquisition_delay * 1e9)
        # The executor and the reader both tare: the lock guards these four.
        self._lock = threading.Lock()
        self._recent = deque(maxlen=self._config.tare_frames)
        self._tare = None
        self._convert = self._calibration.converter()
        self._frames_to_tare = self._config.tare_frames if self._config.tare_at_start else 0
        self._tare_refusal = 'frames are awaited' if self._frames_to_tare else 'not asked to'

        self._image_msg = TactileImageMsg()
        self._fault = f'{self._config.port} is not open yet'
        self._impossible = False  # whether counts arrived that the calibration excludes
        self._last_byte_at = self._last_frame_at = time.monotonic()
        self._reported = Report(time.monotonic())
        self._shown: tuple[bytes, str] | None = None

        self._images = self.create_publisher(TactileImageMsg, 'image', qos_profile_sensor_data)
        self._infos = self.create_publisher(SensorInfoMsg, 'sensor_info', _LATCHED)
        self.create_service(Trigger, '~/tare', self._on_tare)
        self._publish_info()
        self._thread.start()

    def destroy_node(self):
        """Stop the reader, then destroy the node; a reader whose port hangs is left behind."""
        self._stop.set()
        if self._thread.ident:  # else the constructor has raised
            self._thread.join(_LAST_READ)
            if self._thread.is_alive():
                self.get_logger().warning(
                    f'{self._config.port} does not answer: its reader is left behind')
        super().destroy_node()

    def _read_forever(self):  # in the reader thread, as what it calls
        while not self._stop.is_set() and self.context.ok():
            try:
                with SensorPort(
                        self._config.port, self._baud, self._frame_size) as port:
                    self._on_connected()
                    while not self._stop.is_set():
                        self._on_bytes(port.read(), port.caught_up_at)
            except OSError as error:
                news = not self._fault
                self._on_disconnected(error)
                # To end together with the sensor, at Ctrl-C, is nothing to warn of.
                if not self._stop.wait(self._config.reconnect_period) and news:
                    self.get_logger().warning(f'{self._config.port} is lost: {error}')
            except RuntimeError:  # of rcl
                if self.context.ok() and not self._stop.is_set():
                    raise
                # It ended between two pictures: nobody is left to publish to.

    def _on_connected(self):
        self._frames.restart()
        self._last_byte_at = self._last_frame_at = time.monotonic()
        self._fault = ''
        self.get_logger().info(f'reading {self._config.port}')

    def _on_disconnected(self, error):
        self._fault = f'{self._config.port} is not there: {error}'
        with self._lock:
            self._recent.clear()

    def _on_bytes(self, data, caught_up_at):
        if not data or self._stop.is_set():
            return
        arrival_ns = self.get_clock().now().nanoseconds
        self._last_byte_at = time.monotonic()
        waited_ns = round(1e9 * (self._last_byte_at - caught_up_at))
        frames = self._frames.receive(data, arrival_ns, arrival_ns - waited_ns)
        for frame, frame_ns in frames:
            self._last_frame_at = self._last_byte_at
            self._publish(frame, max(frame_ns - self._delay_ns, 0))

    def _publish(self, frame, stamp_ns):
        """Publish one picture of an instant [ns]."""
        with self._lock:
            self._recent.append(frame.counts)
            convert, tared = self._convert, self._tare is not None
        self._impossible |= bool(self._calibration.counts.outside(frame.counts).any())
        layer, saturated = convert(frame.counts)
        self._images.publish(image_to_msg(TactileImage(
            stamp_ns, frame.sequence, (layer,), self._calibration.array, tared, saturated,
            self._config.frame_id, self._config.sensor), self._image_msg))
        if self._frames_to_tare:
            self._tare_at_start()

    def _tare_at_start(self):
        self._frames_to_tare -= 1
        if self._frames_to_tare == 0:
            try:
                self._take_tare()
            except TareRefusedError:
                self._frames_to_tare = self._config.tare_frames

    def _take_tare(self):
        """Tare with the newest pictures, in either thread; raises TareRefusedError."""
        with self._lock:
            frames = list(self._recent)
            try:
                if len(frames) < self._config.tare_frames:
                    raise TareRefusedError(
                        f'no frames: {len(frames)} of {self._config.tare_frames} have arrived')
                if time.monotonic() - self._last_frame_at > _SILENCE:
                    raise TareRefusedError('no frames: the last one is older than a second')
                tare = self._tare = self._calibration.make_tare(frames)
            except TareRefusedError as error:
                self._tare_refusal = str(error)
                raise
            self._convert = self._calibration.converter(tare)
            self._frames_to_tare = 0
        self._publish_info()
        self.get_logger().info(f'tared, noise {tare.noise_std:.2f} counts')
        return tare

    def _publish_info(self):
        now_ns = self.get_clock().now().nanoseconds
        self._infos.publish(sensor_info_to_msg(self._calibration.sensor_info(
            self._config.sensor, self._config.frame_id, now_ns, self._tare,
            now_ns if self._tare else 0)))

    def _on_tare(self, _, response):
        # Pictures that are already there answer at once: neither blocking nor awaiting new ones
        # in a callback lets a single-threaded executor serve the rest of the graph meanwhile.
        try:
            response.message = f'noise {self._take_tare().noise_std:.2f} counts'
            response.success = True
        except TareRefusedError as error:
            response.message = str(error)
        return response

    def _on_diagnose(self):
        now = time.monotonic()
        decoder, before = self._decoder, self._reported
        self._reported = Report(now, decoder.frames, decoder.dropped_bytes, self._frames.stalled,
                                self._frames.thinned)
        rate = (decoder.frames - before.frames) / (now - before.at)
        level, text = self._state(now, before)
        shown = level, text
        if self.starting and self._tare is None:
            shown = DiagnosticStatus.OK, f'starting: {text}'
        if shown != self._shown:
            self._shown = shown
            self._log(*shown)
        values = {
            'rate': f'{rate:.1f}', 'frames': decoder.frames, 'lost_frames': decoder.lost_frames,
            'resyncs': decoder.resyncs, 'dropped_bytes': decoder.dropped_bytes,
            'stalled_frames': self._frames.stalled, 'thinned_frames': self._frames.thinned,
            'locked': decoder.locked, 'tared': self._tare is not None,
        }
        self.diagnose(level, text, values, name=self._config.sensor,
                      hardware_id=self._config.port)

    def _log(self, level, text):
        # The logger refuses a second severity from the same line.
        if level == DiagnosticStatus.ERROR:
            self.get_logger().error(text)
        elif level == DiagnosticStatus.WARN:
            self.get_logger().warning(text)
        else:
            self.get_logger().info(text)

    def _state(self, now, before):
        """Level and text of the driver's state since the last report, the gravest first."""
        if not self._thread.is_alive():
            return DiagnosticStatus.ERROR, 'the reader has stopped'
        if self._fault:
            return DiagnosticStatus.ERROR, self._fault
        if now - self._last_byte_at > _SILENCE:
            return DiagnosticStatus.ERROR, f'{self._config.port} is silent'
        if now - self._last_frame_at > _SILENCE:
            return DiagnosticStatus.ERROR, self._no_frames()
        if self._impossible:
            counts, self._impossible = self._calibration.counts, False
            return DiagnosticStatus.WARN, (
                f'counts outside {counts.lowest} to {counts.highest} arrive, which `bits: '
                f'{counts.bits}` of the calibration excludes: set `bits` and `signed` there')
        if self._tare is None:
            return DiagnosticStatus.WARN, f'not tared: {self._tare_refusal}'
        if self._reported.thinned > before.thinned:
            return DiagnosticStatus.WARN, (
                f'pictures come too fast: more than {self._frames.limit:g} Hz, the most that is '
                "published (6 times the calibration's nominal_rate)")
        if self._reported.stalled > before.stalled:
            return DiagnosticStatus.WARN, 'pictures were dropped whose bytes stalled in the middle'
        if self._reported.dropped_bytes > before.dropped_bytes:
            return DiagnosticStatus.WARN, 'bytes were dropped'
        return DiagnosticStatus.OK, 'frames arrive'

    def _no_frames(self):
        rows, columns = self._calibration.array.shape
        text = f'bytes arrive on {self._config.port}, but no frame of {rows}x{columns}'
        reason = self._decoder.explain()
        if reason:
            return f'{text} = {self._frame_size} bytes: {reason}'
        return f'{text}: wrong sensor, size or baud rate'


def main(args=None) -> int:
    """Run the driver."""
    return run(DriverNode, args)
