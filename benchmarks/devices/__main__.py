"""
Processor time of a frame from its bytes to a published message, for every protocol.

The requirement is 16 x 16 tactels at 1 kHz and 32 x 32 at 400 Hz on one core. The ratio is the
frame rate that one core could process, divided by the required rate. With --port the bytes go
through a pseudo-terminal and pyserial in real time, and lost frames are counted: fewer than 0.1 %
are required. Prints a table.
"""
import argparse
import os
import threading
import time
import tty

import numpy as np
import rclpy
from rclpy.qos import qos_profile_sensor_data

from tactile_msgs.msg import TactileImage
from tactile_sensing.conversions import image_to_msg
from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.devices.frame_clock import FrameClock
from tactile_sensing.devices.image_converter import ImageConverter
from tactile_sensing.devices.registry import options_of, protocol_named, PROTOCOLS
from tactile_sensing.devices.stream import SensorStream

CASES = ((16, 1000.0), (32, 400.0))  # tactels per side; rate [Hz]
OPTIONS = {'csv_lines': 'stamp=us checksum=true', 'weiss_wts': '', 'weiss_dsa': 'rle=false'}
FRAMES, SECONDS = 1000, 5.0
SHARE = 1e-3  # of frames that may be lost


def packets_of(protocol, shape, rate):
    """Return preamble and frames of a device as bytes."""
    row, options = protocol_named(protocol), options_of(protocol, OPTIONS.get(protocol, ''))
    device, rng = row.device(**options), np.random.default_rng(0)
    device.answer(row.decoder(*shape, **options).start(rate))
    counts = rng.integers(0, 200, (FRAMES, *shape), np.uint8)
    return device.preamble, [device.encode(image, round(k * 1e9 / rate))
                             for k, image in enumerate(counts)]


def publisher_of(node, shape, rate):
    """Return a function that publishes a frame of a pad, as the driver does."""
    pad = ImageConverter(Calibration.uncalibrated(*shape, 1e-3, nominal_rate=rate))
    message, topic = TactileImage(), node.create_publisher(
        TactileImage, 'image', qos_profile_sensor_data)
    return lambda image: topic.publish(image_to_msg(
        pad.image(image.counts, image.stamp_ns, image.sequence), message))


def ratio(node, protocol, side, rate):
    """Return the frame rate of one core over the required rate, and the published share."""
    shape = protocol_named(protocol).shape or (side, side)
    preamble, packets = packets_of(protocol, shape, rate)
    options = options_of(protocol, OPTIONS.get(protocol, ''))
    clock = FrameClock(protocol_named(protocol).decoder(*shape, np.uint8, **options), rate)
    publish, done = publisher_of(node, shape, rate), 0
    clock.receive(preamble, 0)
    begin = time.process_time()
    for k, packet in enumerate(packets):
        for image in clock.receive(packet, round((k + 1) * 1e9 / rate)):
            publish(image)
            done += 1
    return FRAMES / (time.process_time() - begin) / rate, done / FRAMES


def lost(node, protocol, side, rate):
    """Return the share of frames that are lost through a pseudo-terminal in real time."""
    shape = protocol_named(protocol).shape or (side, side)
    preamble, packets = packets_of(protocol, shape, rate)
    master, slave = os.openpty()
    tty.setraw(slave)
    stream = SensorStream(os.ttyname(slave), protocol, shape, kind=np.uint8, rate=rate,
                          options=options_of(protocol, OPTIONS.get(protocol, '')))
    publish, count, done = publisher_of(node, shape, rate), round(SECONDS * rate), 0
    stream.connect()
    os.write(master, preamble)

    def send():
        begin = time.monotonic()
        for k in range(count):
            time.sleep(max(begin + k / rate - time.monotonic(), 0.0))
            data = packets[k % FRAMES]
            while data:
                data = data[os.write(master, data):]
    sender = threading.Thread(target=send)
    sender.start()
    end = time.monotonic() + SECONDS + 2.0
    while done < count and time.monotonic() < end:
        for image in stream.read():
            publish(image)
            done += 1
    sender.join()
    stream.close()
    os.close(slave)
    os.close(master)
    return 1.0 - done / count


def main():
    """Measure and print."""
    parser = argparse.ArgumentParser(prog='./ws bench devices', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--port', action='store_true', help='through pseudo-terminals as well')
    parser.add_argument('--quick', action='store_true', help='as without')
    options = parser.parse_args()
    rclpy.init()
    node = rclpy.create_node('bench')
    print('| protocol | 16 x 16, 1 kHz | 32 x 32, 400 Hz |\n| --- | --- | --- |')
    for protocol in PROTOCOLS:
        cells = []
        for side, rate in CASES:
            times, share = ratio(node, protocol, side, rate)
            cells.append(f'{times:.1f} times' + f', {1.0 - share:.2%} missing' * (share < 1.0))
            if options.port:
                cells[-1] += f', {lost(node, protocol, side, rate):.3%} lost'
        print(f'| {protocol} | {" | ".join(cells)} |', flush=True)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == '__main__':
    main()
