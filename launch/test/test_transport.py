"""The profiles that keep a graph to this host, seen in what a node's process listens to."""
import os
from pathlib import Path
import subprocess
import sys
from xml.etree import ElementTree

import pytest

from edge_tracking.resources import share
from edge_tracking.transport import lease_environment, local_environment, PROFILES, RANGE

LOOPBACK = ('0100007F', '00000000000000000000000001000000')  # as /proc/net prints 127.0.0.1, ::1
# A node in a context of its own, then the local address of each of its process' sockets.
PROGRAM = """
import os, rclpy
rclpy.init()
node = rclpy.create_node('sockets')
node.create_publisher(__import__('std_msgs.msg').msg.String, 'text', 1)
own = set()
for entry in os.listdir('/proc/self/fd'):
    try:
        own.add(os.readlink(f'/proc/self/fd/{entry}'))
    except OSError:
        pass
for kind in ('udp', 'udp6', 'tcp', 'tcp6'):
    try:
        lines = open(f'/proc/net/{kind}').readlines()[1:]
    except FileNotFoundError:
        continue
    for line in lines:
        fields = line.split()
        if f'socket:[{fields[9]}]' in own:
            print(fields[1].split(':')[0])
"""
# The names of the threads of a node's process.
THREADS = """
from pathlib import Path
import rclpy
rclpy.init()
node = rclpy.create_node('threads')
print(*(task.joinpath('comm').read_text().strip() for task in Path('/proc/self/task').iterdir()))
"""
# A node that is killed without a word, and one that prints how long it goes on counting it.
KILLED = """
import subprocess, sys, time, rclpy
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node('observer' if len(sys.argv) > 1 else 'killed')
if len(sys.argv) == 1:
    node.create_publisher(String, 'text', 1)
    rclpy.spin(node)
other = subprocess.Popen([sys.executable, '-c', sys.argv[1]])
while not node.count_publishers('text'):
    rclpy.spin_once(node, timeout_sec=0.01)
other.kill()
begin = time.monotonic()
while node.count_publishers('text'):
    rclpy.spin_once(node, timeout_sec=0.01)
print(time.monotonic() - begin)
"""
fast_dds = pytest.mark.skipif(
    'fastrtps' not in os.environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp'),
    reason='another middleware than Fast DDS')


def plain():
    """Environment of this process without what says who may be heard."""
    chosen = (RANGE, 'ROS_STATIC_PEERS', 'FASTRTPS_DEFAULT_PROFILES_FILE', *PROFILES)
    return {name: value for name, value in os.environ.items() if name not in chosen}


def addresses(environment):
    """Local addresses of the sockets of a node's process."""
    done = subprocess.run([sys.executable, '-c', PROGRAM], env=environment, check=True,
                          capture_output=True, text=True, timeout=60)
    return done.stdout.split()


@pytest.mark.skipif(not Path('/proc/net/udp').exists(), reason='no /proc/net: not Linux')
@fast_dds
def test_a_node_has_loopback_sockets_alone():
    found = addresses(plain() | local_environment(plain()))
    assert found and set(found) <= set(LOOPBACK)
    # Without the profile the range LOCALHOST leaves sockets that any host can send to.
    assert '00000000' in addresses(plain() | {RANGE: 'LOCALHOST'})


@pytest.mark.skipif(not Path('/proc/self/task').exists(), reason='no /proc: not Linux')
@pytest.mark.parametrize('restricted', [local_environment, lease_environment])
@fast_dds
def test_fast_dds_exchanges_no_types_because_that_can_crash(restricted):
    done = subprocess.run([sys.executable, '-c', THREADS], env=plain() | restricted(plain()),
                          check=True, capture_output=True, text=True, timeout=60)
    assert 'dds.udp' in done.stdout and 'dds.tls' not in done.stdout  # type lookup service


@fast_dds
def test_a_node_that_was_killed_is_missed_before_the_usual_lease_is_over():
    done = subprocess.run(
        [sys.executable, '-c', KILLED, KILLED], check=True, capture_output=True, text=True,
        timeout=60, env=plain() | local_environment(plain()))
    assert float(done.stdout) < 15.0  # of a lease of 2 s; Fast DDS's own is 20


@pytest.mark.parametrize('name', [RANGE, 'ROS_STATIC_PEERS', 'FASTRTPS_DEFAULT_PROFILES_FILE',
                                  *PROFILES])
def test_what_the_user_has_set_stays(name):
    assert local_environment({name: 'x'}) == {}


def test_an_unknown_middleware_gets_the_range():
    assert local_environment({'RMW_IMPLEMENTATION': 'rmw_zenoh_cpp'}) == {RANGE: 'LOCALHOST'}


@pytest.mark.parametrize('name', ['fastdds_local.xml', 'fastdds_lease.xml'])
def test_who_died_is_missed_after_two_seconds(name):
    tree = ElementTree.parse(share('config', name))
    lease, = (element for element in tree.iter() if element.tag.endswith('leaseDuration'))
    assert [element.text for element in lease] == ['2']
    assert lease_environment({'CYCLONEDDS_URI': 'file://own'}) == {}
    assert Path(lease_environment({})['FASTDDS_DEFAULT_PROFILES_FILE']).is_file()


@pytest.mark.parametrize('name', ['fastdds_local.xml', 'cyclonedds_local.xml'])
def test_profiles_name_no_address_but_loopback(name):
    tree = ElementTree.parse(share('config', name))
    found = [text for element in tree.iter() for text in
             (element.get('address'), element.text if element.tag.endswith('address') else None)
             if text]
    assert found and set(found) == {'127.0.0.1'}
