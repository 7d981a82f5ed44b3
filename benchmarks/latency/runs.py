"""One run of the graph, with processor times and latencies."""

from contextlib import contextmanager
import os
from pathlib import Path
import struct
import subprocess
import sys
import tempfile
import time

import numpy as np
import yaml

from benchmarks.latency.meter import Journey, Meter
from edge_tracking.graph import add_servo, calibrate, EdgeServoNode, Graph, private_port
from edge_tracking.process_group import apart
from edge_tracking.resources import share
from edge_tracking.track import TrackNode
from tactile_common.ros.runner import freeze_heap
from tactile_servo import config, inputs
from tactile_servo.laws import resolved_rate
from tactile_servo.supervisor import Supervisor
from tactile_servo.types import TRACKING
from tactile_simulation.scene import find_scene, load_scene

SPEED, FORCE, LENGTH = 0.03, 5.0, 0.12  # m/s, N, m
NODE = sys.modules[EdgeServoNode.__module__]
ROBOT = share('urdf', 'puma260.urdf')
PROBE_TIMEOUT = 20.0  # s
PATIENCE = 0.5  # s without an input before the servo holds, on a busy machine

BLOCK = 20  # cycles timed as a whole; the next 20 are timed by their parts
# Name of a part -> owner and attribute; parts with - are inside a cycle.
CYCLE = 'cycle'
BAR = 0.4e-3  # s; required time of a cycle
PARTS = {
    'a joint state': (EdgeServoNode, '_on_joints'),
    'a picture heard': (EdgeServoNode, '_on_image'),
    '- pictures and contacts unpacked': (NODE, 'unpacked'),
    '- picture converted': (NODE, 'image_from_msg'),
    '- contact converted': (NODE, 'contact_from_msg'),
    '- picture traced': (Supervisor, 'see_image'),
    '- contact taken': (Supervisor, 'see_contact'),
    '- decided, and moved on': (Supervisor, 'cycle'),
    '- command laid out': (NODE, 'trajectory_to_msg'),
    '- status laid out': (NODE, 'status_to_msg'),
}


def account(tracker, rate):
    """Run once; return processor times and latencies."""
    for module in (config, inputs, resolved_rate):
        module.STALE_AFTER = module.MAX_STAMP_AGE = PATIENCE
    path, meter, journey = find_scene('straight'), Meter(), Journey()
    scene = load_scene(path)
    domain = int(os.environ.get('ROS_DOMAIN_ID', os.getpid() % 100 + 1))
    parts = {name: part for name, part in PARTS.items() if hasattr(*part)}
    with tempfile.TemporaryDirectory() as folder:
        parameters = Path(folder, 'parameters.yaml')
        parameters.write_text(yaml.safe_dump(_parameters(rate)), 'utf-8')
        common = {'parameters': parameters, 'domain': domain}
        heard = Path(folder, 'heard.npz')
        with private_port() as port, _probe(heard, domain) as probe, \
                apart('mocks', port, path, ROBOT, 0, **common), \
                apart('sensing', port, calibrate(port, scene), **common), \
                Graph(**common) as graph, meter.timing(parts), _following(meter, journey):
            servo = add_servo(graph, ROBOT, tracker)
            servo._trajectory.publish = _sent(meter, journey, servo._trajectory.publish)
            servo._status.publish = meter.timed('- status sent', servo._status.publish)
            track = graph.add(TrackNode, speed=SPEED, force=FORCE, length=LENGTH)
            freeze_heap()
            clocks = [_clocks(servo)]

            def watch():
                running = servo._servo.state in TRACKING
                if running != meter.running:  # begin and end alternate in `clocks`
                    meter.running = running
                    clocks.append(_clocks(servo))
                return track.finished

            graph.spin(watch)
            probe.communicate(timeout=PROBE_TIMEOUT)
        with np.load(heard) as file:
            times = {name: dict(file[name].tolist()) for name in ('image', 'contact')}
    if len(clocks) < 3:
        raise SystemExit(f'nothing was tracked: {track.reason}')
    wall, thread, process, cycles, missed = np.diff(clocks, axis=0)[1::2].sum(axis=0)
    delay_ns = round(1e9 * servo._servo.inputs.sensor.acquisition_delay)
    stages = journey.stages(times['image'], delay_ns)
    common = times['image'].keys() & times['contact'].keys()
    stages['contact'] = 1e-9 * np.array(
        [times['contact'][stamp] - times['image'][stamp] for stamp in sorted(common)])
    return {
        'tracker': tracker, 'rate': rate, 'ok': track.success, 'reason': track.reason,
        'seconds': wall, 'cycles': int(cycles), 'missed': int(missed),
        'thread': thread / cycles, 'process': process / cycles,
        'cpu': _costs(meter.times, cycles),
        'latency': {name: _quantiles(times) for name, times in stages.items() if len(times)}}


def _costs(times, cycles):
    """Return processor times of a cycle and of its parts, with their calls per cycle."""
    whole = len(times[CYCLE])
    costs = {CYCLE: _quantiles(times[CYCLE]) | {'calls': 1.0}}
    for name, some in times.items():
        if some and name != CYCLE:
            costs[name] = _quantiles(some) | {'calls': len(some) / (cycles - whole)}
    return costs


def _clocks(servo):
    return (time.perf_counter(), time.thread_time(), time.process_time(), servo._pace.cycles,
            servo._pace.missed)


def _parameters(rate):
    tree = yaml.safe_load(share('config', 'edge_tracking.yaml').read_text('utf-8'))
    tree['/**/mock_sensor']['ros__parameters']['rate'] = rate
    return tree


def _quantiles(values):
    p50, p99 = np.percentile(values, (50, 99)).tolist()
    return {'mean': float(np.mean(values)), 'p50': p50, 'p99': p99}


@contextmanager
def _probe(path, domain):
    process = subprocess.Popen(
        [sys.executable, '-m', 'benchmarks.latency.probe', str(path), str(domain)],
        stdin=subprocess.PIPE, preexec_fn=lambda: os.nice(10))
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@contextmanager
def _following(meter, journey):
    """Record arrivals of images, begins of cycles and images used by the law; time the cycles."""
    on_image, on_cycle = EdgeServoNode._on_image, EdgeServoNode._on_cycle
    timed = meter.timed(CYCLE, on_cycle, whole=True)
    see_image = Supervisor.see_image

    def hear(self, raw):
        sec, nanosec = struct.unpack_from('<iI', raw, 4)
        journey.hear(sec * 10**9 + nanosec)
        on_image(self, raw)

    def begin(self):
        journey.begin()
        meter.inside = True
        timed(self)
        meter.inside = False
        meter.apart = self._pace.cycles // BLOCK % 2 == 1

    def use(self, image, arrival):
        journey.use(image.stamp_ns)
        see_image(self, image, arrival)

    EdgeServoNode._on_image, EdgeServoNode._on_cycle = hear, begin
    Supervisor.see_image = use
    try:
        yield
    finally:
        EdgeServoNode._on_image, EdgeServoNode._on_cycle = on_image, on_cycle
        Supervisor.see_image = see_image


def _sent(meter, journey, publish):
    timed = meter.timed('- command sent', publish)

    def call(message):
        timed(message)
        journey.send()
    return call
