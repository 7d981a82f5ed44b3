"""Program of `calibrate --live`: records presses of the sensor whose pictures are published."""
from pathlib import Path
import queue
import sys
import threading

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

SILENCE = 5.0  # s without a picture
KEPT = 1000  # pictures that wait at most


class PicturesMissingError(TactileError):
    """No pictures come; the message says what to do."""


class PressRecorderNode(TactileNode):
    """Keeps the pictures of a topic until they are looked at."""

    def __init__(self, topic, **kwargs):
        super().__init__('press_recorder', **kwargs)
        self._pictures: queue.Queue[TactileImage] = queue.Queue(KEPT)
        self.topic = topic
        self.create_subscription(TactileImageMsg, topic, self._on_image, qos_profile_sensor_data)

    def _on_image(self, message):
        try:
            self._pictures.put_nowait(image_from_msg(message))
        except queue.Full:
            self.forget()
        except TactileError as error:
            self.get_logger().warning(f'image: {error}', throttle_duration_sec=5.0)

    def forget(self) -> None:
        """Drop what waits: it is of the time before a question was answered."""
        while not self._pictures.empty():
            self._pictures.get_nowait()

    def next(self) -> TactileImage:
        """Wait for a picture; a PicturesMissingError if none comes."""
        try:
            image = self._pictures.get(timeout=SILENCE)
        except queue.Empty:
            raise PicturesMissingError(
                f'no picture on {self.topic} for {SILENCE:g} s: is the driver running?') from None
        return image


def record(node: PressRecorderNode, folder: Path) -> None:
    """Ask, listen and keep."""
    def ask(text):
        answer = input(text)
        node.forget()
        return answer
    Recorder(folder, node.next().array, lambda: node.next().raw_counts(), ask, print).run()


def main(args: list[str] | None = None) -> int:
    """Record into the folder that is given, from the topic behind it."""
    folder, topic = sys.argv[1:3] if args is None else args
    context = rclpy.Context()
    rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
    node = PressRecorderNode(topic, context=context)
    executor, stop = make_executor(context), threading.Event()
    executor.add_node(node)
    thread = threading.Thread(target=spin, args=(executor, context, stop.is_set))
    thread.start()
    try:
        record(node, Path(folder))
    except (TactileError, OSError, EOFError) as error:
        print(f'calibrate: {error or "no more answers"}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f'calibrate: interrupted; what was recorded is in {folder}', file=sys.stderr)
        return 130
    finally:
        stop.set()
        thread.join()
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
