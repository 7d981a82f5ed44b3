"""Read a sensor whose own driver publishes images or arrays."""
from collections.abc import Callable
import time
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image
from std_msgs.msg import Float32MultiArray, UInt16MultiArray

from tactile_common.errors import TactileError
from tactile_common.ros.conversions import stamp_to_ns
from tactile_sensing.conversions import counts_from_msg
from tactile_sensing.devices.stream import SILENCE

LOOK_PERIOD = 0.5  # time between checks for a publisher [s]
TYPES = {'sensor_msgs/msg/Image': Image, 'std_msgs/msg/Float32MultiArray': Float32MultiArray,
         'std_msgs/msg/UInt16MultiArray': UInt16MultiArray}


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
