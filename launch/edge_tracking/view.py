"""
Live view: a read-only web page with tactile image, contact, path, force, state and reason.

Also publishes `image/view`, the image with the contact drawn in, while someone subscribes.
"""
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import resources
import json
import math
import sys
from typing import Any

from geometry_msgs.msg import PoseStamped
import numpy as np
from rclpy.qos import qos_profile_sensor_data, QoSProfile, ReliabilityPolicy
from rclpy.timer import Timer
from sensor_msgs.msg import Image

from edge_tracking.resources import NAMESPACE
from edge_tracking.web.page import COLOURS, INVALID, levels, make_page, packed
from edge_tracking.web.server import NOTHING, Server
from tactile_common.command_line import Parser, refusing, to_json
from tactile_common.config import bounded, documented
from tactile_common.errors import TactileError
from tactile_common.ros.cdr import unpacked
from tactile_common.ros.conversions import name_in, set_stamp, stamp_to_ns
from tactile_common.ros.node import TactileNode
from tactile_common.ros.parameters import declare_from
from tactile_common.ros.runner import run, split_ros_args
from tactile_msgs.msg import Contact, ServoStatus, TactileImage
from tactile_sensing.conversions import image_from_msg
from tactile_sensing.types.contact import ContactType, Reason
from tactile_servo.types import State

ATTENTION = 0.5  # s between checks for viewers
PERIOD = 1.0 / 30.0  # s between shown images
FADING = 0.995  # factor per image for the pressure of the darkest colour
NOISES = 20.0  # smallest value of this pressure, in standard deviations of a tactel
WIDTH = 320  # of `image/view` [px]
ESTIMATE = (16, 164, 184)
PALETTE = np.vstack([np.column_stack([
    np.interp(np.linspace(0.0, len(COLOURS) - 1.0, INVALID), np.arange(len(COLOURS)), part)
    for part in np.array(COLOURS).T]), (223, 226, 231)]).round().astype(np.uint8)


def live_page() -> str:
    """Return the HTML of the page."""
    body = (resources.files('edge_tracking.web') / 'live.html').read_text('utf-8')
    return make_page('Live touch', body, ('tactile.js', 'live.js'), connect="'self'")


@dataclass(frozen=True)
class ViewConfig:
    """Address of the page."""

    host: str = documented(
        '127.0.0.1',
        'address to serve at; where others reach it a token is asked for, see the log')
    port: int = bounded(8088, 'to serve at; 0 = any that is free', '', 0, 65535)


class ViewNode(TactileNode):
    """
    Serve the page. Parameters: `ViewConfig`.

    Without viewers it subscribes to nothing. Of each topic only the newest message is decoded,
    when the next image is due.
    """

    def __init__(self, **kwargs: Any):
        super().__init__('view', **{'namespace': NAMESPACE, **kwargs})
        config = declare_from(self, ViewConfig)
        self._server = Server(config.host, config.port, live_page())
        self._picture = self.create_publisher(Image, 'image/view', qos_profile_sensor_data)
        # Type of the messages of each topic, and what is shown of the newest one.
        self._read: dict[str, tuple[type, Callable[[Any], Any]]] = {
            'image': (TactileImage, self._image), 'contact': (Contact, _contact),
            'servo_status': (ServoStatus, _status),
            'sensor_pose': (PoseStamped, lambda message: [
                getattr(message.pose.position, axis) for axis in 'xyz'])}
        self._heard: dict[str, bytes] = {}  # newest message by topic
        self._listening: list[Any] = []
        self._timer: Timer | None = None
        self._shown: dict[str, Any] = {}
        self._top, self._rate, self._last = 0.0, 0.0, (0, 0)
        self.create_timer(ATTENTION, self._attend, clock=self.steady)
        self.get_logger().info(f'live view at {self._server.url}')

    def _attend(self) -> None:
        watched = self._server.watched or self._picture.get_subscription_count()
        if watched and not self._timer:
            newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
            self._listening = [self.create_subscription(
                kind, name, partial(self._heard.__setitem__, name), newest, raw=True)
                for name, (kind, _) in self._read.items()]
            self._timer = self.create_timer(PERIOD, self._show, clock=self.steady)
        elif self._timer and not watched:
            self.destroy_timer(self._timer)
            self._timer = None
            for subscription in self._listening:
                self.destroy_subscription(subscription)
            self._listening, self._shown, self._server.newest = [], {}, NOTHING
            self._heard.clear()

    def _show(self) -> None:
        new = {}
        for name, (kind, read) in self._read.items():
            try:
                if raw := self._heard.pop(name, None):
                    new[name] = read(unpacked(raw, kind))
            except TactileError as error:
                self._warn(f'{name} ignored: {error}')
        if not new:
            return
        self._shown = {**self._shown, 'sensor_pose': None, **new}
        header, shades, image = self._shown.get('image', (None, None, None))
        contact = self._shown.get('contact', {})
        self._server.newest = to_json({
            'image': image, 'contact': contact or None,
            'status': self._shown.get('servo_status'), 'position': self._shown['sensor_pose'],
            'stamp': self.steady.now().nanoseconds}).encode()
        if 'image' in new and self._picture.get_subscription_count():
            self._picture.publish(drawn(header, shades, image['pitch'], contact.get('place')))

    def _image(self, message: Any) -> tuple[Any, np.ndarray, dict[str, Any]]:
        """Return header, levels and the page's data of an image."""
        image = image_from_msg(message)
        layer = min((it for it in image.layers if it.component == 'zz'),
                    key=lambda it: it.depth, default=None)
        if layer is None:
            raise TactileError('no layer of pressure')
        pressure = np.where(np.isfinite(layer.stress), layer.stress, np.nan)
        most = float(np.nanmax(pressure, initial=0.0))
        self._top = max(most, FADING * self._top, NOISES * layer.noise_std, 1e-9)
        stamp, (last, sequence) = stamp_to_ns(message.header.stamp), self._last
        if 0 < last < stamp and sequence < message.sequence:  # else it has just begun
            rate = 1e9 * (message.sequence - sequence) / (stamp - last)
            self._rate = rate if not self._rate else 0.9 * self._rate + 0.1 * rate
        self._last = stamp, message.sequence
        shades = levels(pressure, self._top)
        return message.header, shades, {
            'rows': message.rows, 'columns': message.columns, 'unit': layer.unit,
            'pitch': [message.pitch_x, message.pitch_y], 'top': self._top, 'rate': self._rate,
            'sensor': message.sensor, 'tared': message.tared, 'levels': packed(shades, 'u1')}

    def destroy_node(self) -> None:
        """Close the page."""
        self._server.close()
        super().destroy_node()


def _contact(message: Any) -> dict[str, Any]:
    place: dict[str, Any] | None = None
    centre = message.centre_of_pressure
    if message.valid:
        place = {name: getattr(message, name) for name in ('x', 'y', 'yaw', 'start', 'end')}
        place['covariance'] = message.covariance[[0, 1, 8]].tolist()
    elif message.type == ContactType.OTHER and math.isfinite(centre.x):
        place = {'x': centre.x, 'y': centre.y, 'yaw': math.nan}
    return {
        'type': name_in(ContactType, message.type), 'place': place, 'force': message.normal_force,
        'reasons': ', '.join(str(it.name).lower() for it in Reason if message.reasons & it)}


def _status(message: Any) -> dict[str, Any]:
    return {'state': name_in(State, message.state), 'reason': message.reason,
            'speed': message.speed, 'progress': message.progress}


def drawn(header: Any, shades: np.ndarray, pitch: list[float], place: dict[str, Any] | None
          ) -> Image:
    """Return the image of levels, enlarged, with rows upwards and the contact drawn in."""
    rows, columns = shades.shape
    factor = max(WIDTH // max(rows, columns), 1)
    x = pitch[0] * ((np.arange(columns * factor) + 0.5) / factor - 0.5 * columns)
    y = pitch[1] * ((np.arange(rows * factor) + 0.5) / factor - 0.5 * rows)[:, None]
    pixels = PALETTE[np.kron(shades, np.ones((factor, factor), np.uint8))]
    if place and math.isfinite(place['x']):
        thick, right, up = 1.2 * max(pitch) / factor, x - place['x'], y - place['y']
        if math.isfinite(place['yaw']):
            on = np.abs(right * np.cos(place['yaw']) + up * np.sin(place['yaw'])) < thick
        else:
            on = np.minimum(np.abs(right), np.abs(up)) < thick
            on &= np.maximum(np.abs(right), np.abs(up)) < 8.0 * thick
        pixels[on] = ESTIMATE
    high, wide, _ = pixels.shape
    image = Image(height=high, width=wide, encoding='rgb8', step=3 * wide,
                  data=array('B', pixels[::-1].tobytes()))
    image.header.frame_id = header.frame_id
    set_stamp(image.header.stamp, stamp_to_ns(header.stamp))
    return image


def main(args: list[str] | None = None) -> int:
    """Serve until interrupted; exit status 2 if the page cannot be served."""
    given, ros = split_ros_args(sys.argv[1:] if args is None else args)
    parser = Parser(
        prog='view', description=(__doc__ or '').strip(),
        epilog='Topics are those of the namespace tactile; another by --ros-args -r __ns:=/NAME')
    parser.add_argument('--host', help='address to serve at, with a token where others '
                        f'reach it; default {ViewConfig.host}')
    parser.add_argument('--port', type=int, help=f'default {ViewConfig.port}; 0: any that is free')
    with refusing('view') as command:
        options = parser.parse_args(given)
        own = [part for name, value in vars(options).items() if value is not None
               for part in ('-p', f'{name}:={json.dumps(value)}')]
        command.status = run(ViewNode, [ros[0], *own, *ros[1:]])
    return command.status
