"""
Benefit of the shortcuts of a control cycle: processor time with and without each of them.

Each is measured alone and multiplied by its calls per cycle of the servo at 400 Hz, with images at
200 Hz. The share is relative to the time of the servo's thread in benchmarks/results/latency.json;
a shortcut that saves less than 5 % should be removed. The heap does not belong to every cycle: its
line is the longest time that a garbage collection stops a servo. Prints a table; run it as a
module.
"""

import argparse
import gc
import json
from time import perf_counter
from timeit import repeat

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from benchmarks.harness import ROOT, table
import edge_tracking.graph  # noqa: F401  loads the same heap as the nodes
from tactile_common.ros.cdr import unpacked
from tactile_common.ros.runner import freeze_heap
from tactile_msgs.msg import Contact
from tactile_sensing.conversions import image_to_msg
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer
from tactile_sensing.types.image import TactileImage as Image

JOINTS = 6


def seconds(function, calls=200, rounds=15):
    """Return the least time of a call [s]."""
    function()
    return min(repeat(function, number=calls, repeat=rounds)) / calls


def messages():
    """Return the messages that a servo receives, and the number of each per cycle."""
    joints = JointState(name=[f'joint_{k}' for k in range(JOINTS)], position=[0.1] * JOINTS,
                        velocity=[0.2] * JOINTS)
    array = TactelArray(16, 16, 1e-3, 1e-3)
    image = image_to_msg(Image(0, 0, (Layer('zz', 2e-3, np.ones((16, 16))),), array, tared=True))
    return (joints, 0.6), (Contact(), 0.5), (image, 0.5)


def measured():
    """Yield rows: shortcut, its time per cycle, and the time without it [s]."""
    times = np.zeros(2)
    for message, calls in messages():
        raw, kind = bytes(serialize_message(message)), type(message)
        times += [calls * seconds(lambda read=read, raw=raw, kind=kind: read(raw, kind))
                  for read in (unpacked, deserialize_message)]
    yield 'messages read by rosbags', *times


def collection():
    """Return the time of a full garbage collection [s]."""
    begin = perf_counter()
    gc.collect()
    return perf_counter() - begin


def main():
    """Print the table."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    results = json.loads((ROOT / 'benchmarks' / 'results' / 'latency.json').read_text('utf-8'))
    cycle = results['runs'][0]['thread']
    rows = [(what, f'{1e6 * own:.1f}', f'{1e6 * other:.1f}',
             f'{100.0 * (other - own) / cycle:.1f} %') for what, own, other in measured()]
    gc.collect()
    other = collection()
    freeze_heap()
    rows.append(('heap frozen', f'{1e6 * collection():.0f}', f'{1e6 * other:.0f}', '-'))
    print(table(('shortcut', 'time [us]', 'plain way [us]', 'buys'), rows))


if __name__ == '__main__':
    main()
