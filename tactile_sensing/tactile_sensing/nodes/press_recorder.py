"""Program of `calibrate --live`: record presses of a sensor whose images are published."""
from collections import deque
from pathlib import Path
import sys
import time
from typing import Any

import rclpy
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions

from tactile_common.errors import TactileError
from tactile_common.ros.node import TactileNode
from tactile_common.ros.runner import make_executor, spin
from tactile_msgs.msg import TactileImage as TactileImageMsg
from tactile_sensing.calibration.recorder import Recorder
from tactile_sensing.conversions import image_from_msg
from tactile_sensing.types.image import TactileImage

SILENCE = 5.0  # longest wait for an image [s]
DISCARD = 0.1  # time after an answer in which images arrive that were waiting [s]


class PressRecorderNode(TactileNode):
    """Receive the images of a topic, only while `ask` or `next` runs."""

    def __init__(self, topic: str, **kwargs: Any):
        super().__init__('press_recorder', **kwargs)
        self._images: deque[TactileImage] = deque()
        self._topic = topic
        self._executor = make_executor(self.context)
        self._executor.add_node(self)
        self.create_subscription(TactileImageMsg, topic, self._on_image, qos_profile_sensor_data)

    def _on_image(self, message: TactileImageMsg) -> None:
        try:
            self._images.append(image_from_msg(message))
        except TactileError as error:
            self.get_logger().warning(f'image: {error}', throttle_duration_sec=5.0)

    def _hear(self, seconds: float, *, until_image: bool) -> None:
        end = time.monotonic() + seconds
        spin(self._executor, self.context,
             lambda: time.monotonic() > end or bool(until_image and self._images))

    def ask(self, text: str) -> str:
        """Ask the user and return the answer; discard images that arrived before it."""
        answer = input(text)
        self._hear(DISCARD, until_image=False)
        self._images.clear()
        return answer

    def next(self) -> TactileImage:
        """Wait for the next image; raise a TactileError if none arrives."""
        self._hear(SILENCE, until_image=True)
        if not self._images:
            raise TactileError(
                f'no picture on {self._topic} for {SILENCE:g} s: is the driver running?')
        return self._images.popleft()


def main(args: list[str] | None = None) -> int:
    """Record into a folder from a topic, the two arguments; return the exit status."""
    folder, topic = sys.argv[1:3] if args is None else args
    context = rclpy.Context()
    rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
    node = PressRecorderNode(topic, context=context)
    try:
        Recorder(Path(folder), node.next().array, lambda: node.next().raw_counts(), node.ask,
                 print).run()
    except (TactileError, OSError, EOFError) as error:
        print(f'calibrate: {error or "no more answers"}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f'calibrate: interrupted; what was recorded is in {folder}', file=sys.stderr)
        return 130
    finally:
        node.destroy_node()
        context.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
