"""Listens to a graph from a separate process: publication times of images and contacts."""

import sys
import threading

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data, QoSProfile

from tactile_common.ros.conversions import stamp_to_ns
from tactile_msgs.msg import Contact, TactileImage

QUEUE = QoSProfile(depth=1000, reliability=qos_profile_sensor_data.reliability)


class ProbeNode(Node):
    """Stores stamps and publication times [ns] of images and contacts."""

    def __init__(self, **kwargs):
        super().__init__('probe', **kwargs)
        self.times = {}
        for name, kind in (('image', TactileImage), ('contact', Contact)):
            self._listen(name, kind)

    def _listen(self, name, kind):
        rows = self.times[name] = []

        def take(message, info):
            rows.append((stamp_to_ns(message.header.stamp), info['source_timestamp']))

        self.create_subscription(kind, name, take, QUEUE)


def main():
    """Listen until the standard input ends; write the times into a file."""
    ended = threading.Event()

    def wait():
        sys.stdin.read()
        ended.set()

    threading.Thread(target=wait, daemon=True).start()
    with rclpy.init(domain_id=int(sys.argv[2])):
        probe = ProbeNode(namespace='tactile')
        executor = SingleThreadedExecutor()  # the events executor gives no publication times
        executor.add_node(probe)
        while not ended.is_set():
            executor.spin_once(timeout_sec=0.1)
    np.savez(sys.argv[1], **{name: np.array(rows, np.int64).reshape(-1, 2)
                             for name, rows in probe.times.items()})


if __name__ == '__main__':
    main()
