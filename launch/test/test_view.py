"""The live view: who may look, what is sent, and that nobody's text becomes markup."""
from array import array
from contextlib import contextmanager
from http.client import HTTPConnection
import json

import numpy as np
import pytest
import rclpy
from rclpy.qos import qos_profile_sensor_data
from recorded_run import messages, straight_scene, TOPICS
from sensor_msgs.msg import Image

from edge_tracking import view as view_module
from edge_tracking.graph import Graph
from edge_tracking.view import drawn, ESTIMATE, main, PALETTE, ViewNode
from edge_tracking.web import server as server_module
from edge_tracking.web.page import INVALID, levels
from edge_tracking.web.server import Server
from tactile_common.errors import ConfigurationError
from tactile_common.ros.cdr import packed, unpacked
from tactile_msgs.msg import TactileImage

HOSTILE = '</script><img src=x onerror=alert(1)>'


@contextmanager
def serving(host='127.0.0.1'):
    server = Server(host, 0, '<p>page</p>')
    try:
        yield server
    finally:
        server.close()


def get(server, path, **headers):
    """Answer of the server, and its text where it is not a stream."""
    connection = HTTPConnection('127.0.0.1', server.server_address[1], timeout=10.0)
    connection.request('GET', path, headers=headers)
    return connection.getresponse()


def test_page_is_for_this_machine_alone():
    with serving() as server:
        answer = get(server, '/')
        assert answer.status == 200 and answer.read() == b'<p>page</p>'
        assert answer.headers['X-Content-Type-Options'] == 'nosniff'
        # A page of another site whose name was made to point here.
        assert get(server, '/', Host='evil.example').status == 403
        assert get(server, '/newest', Host='evil.example').status == 403
        assert get(server, '/', Host='[').status == 403
        assert get(server, '/../../etc/passwd').status == 404


def test_others_need_the_token():
    with serving('0.0.0.0') as server:
        assert server.url.endswith(f'/?token={server.token}') and len(server.token) > 20
        for wrong in ('/', '/?token=', '/?token=x', '/newest', '/?token=%ff'):
            assert get(server, wrong).status == 403
        assert get(server, f'/?token={server.token}').status == 200


def test_the_newest_message_is_told_and_who_asks_for_it_watches(monkeypatch):
    with serving() as server:
        assert not server.watched
        assert get(server, '/newest').read() == b'null' and server.watched
        server.newest = b'{"a": 1}'
        connection = HTTPConnection('127.0.0.1', server.server_address[1], timeout=10.0)
        for _ in range(2):  # one connection is enough
            connection.request('GET', '/newest')
            answer = connection.getresponse()
            assert answer.headers['Content-Type'] == 'application/json'
            assert answer.read() == b'{"a": 1}'
        monkeypatch.setattr(server_module, 'LEFT', 0.0)
        assert not server.watched


def test_a_port_that_is_taken_is_refused(capsys):
    with serving() as server:
        with pytest.raises(ConfigurationError, match='cannot be served'):
            Server('127.0.0.1', server.server_address[1], '')
        assert main(['--port', str(server.server_address[1])]) == 2
        assert 'cannot be served' in capsys.readouterr().err
    assert main(['--port', '123456']) == 2


def test_levels_round_and_mark_what_is_missing():
    assert levels(np.array([-1.0, 0.0, 0.5, 1.0, 2.0, np.nan]), 1.0).tolist() == [
        0, 0, 127, 254, 254, INVALID]


@pytest.mark.parametrize('place, at, beside', [
    ({'x': 0.0, 'y': 0.0, 'yaw': 0.0}, (10, 160), (160, 10)),  # a line along y
    ({'x': -2e-3, 'y': 1e-3, 'yaw': np.nan}, (140, 120), (10, 120))])  # a cross
def test_image_has_rows_upwards_and_the_contact(place, at, beside):
    shades = np.zeros((16, 16), np.uint8)
    shades[15, 0] = 254  # the last row is the highest
    image = drawn(Image().header, shades, [1e-3, 1e-3], place)
    pixels = np.frombuffer(bytes(image.data), np.uint8).reshape(image.height, image.width, 3)
    assert (image.height, image.width, image.encoding, image.step) == (320, 320, 'rgb8', 960)
    assert tuple(pixels[at]) == ESTIMATE and tuple(pixels[beside]) == tuple(PALETTE[0])
    assert tuple(pixels[0, 0]) == tuple(PALETTE[254])


@pytest.fixture
def image():
    return next(message for topic, _, message in messages(straight_scene())
                if topic == '/tactile/image')


@pytest.mark.graph
def test_a_pressure_that_is_not_finite_is_invalid_and_has_no_effect_on_others(image):
    image.layers[0].stress[:4] = array('f', (np.nan, np.inf, -np.inf, 1e5))
    with Graph() as graph:
        view = graph.add(ViewNode, port=0)
        _, shades, shown = view._image(unpacked(packed(image), TactileImage))
        assert shades[0, :4].tolist() == [INVALID, INVALID, INVALID, 254]
        assert shown['top'] == pytest.approx(1e5)


@pytest.mark.graph
def test_the_rate_is_that_of_one_stream(image):
    with Graph() as graph:
        view, shown = graph.add(ViewNode, port=0), []
        for seconds, sequence in ((7, 1000), (8, 1200), (9, 3), (10, 203)):  # a driver restarts
            image.header.stamp.sec, image.sequence = seconds, sequence
            shown.append(view._image(unpacked(packed(image), TactileImage))[2]['rate'])
        assert shown == pytest.approx([0.0, 200.0, 200.0, 200.0])


@pytest.mark.parametrize('host', ['', '::', '1', 'yes', '"'])
def test_any_address_reaches_the_node(host, monkeypatch, capsys):
    def refuse(host, *_):
        raise ConfigurationError(f'the address is {host!r}')
    monkeypatch.setattr(view_module, 'Server', refuse)
    assert main(['--host', host]) == 2
    assert f'the address is {host!r}' in capsys.readouterr().err


@pytest.mark.graph
def test_view_of_a_sensor():
    scene = straight_scene()
    told = {}
    for topic, stamp, message in messages(scene):
        if stamp < 1_700_000_002 * 10**9:
            told[topic] = message
    told['/tactile/servo_status'].reason = HOSTILE
    with Graph() as graph:
        view = graph.add(ViewNode, port=0)
        sender = graph.add(rclpy.node.Node, own={'node_name': 'sender'})
        topics = [(sender.create_publisher(kind, name, qos), told[name])
                  for name, kind, qos in TOPICS if name in (
                      '/tactile/image', '/tactile/contact', '/tactile/servo_status')]
        spin(graph, lambda: False, 1.0)
        assert not any(it.get_subscription_count() for it, _ in topics)  # nobody looks
        port = int(view._server.url.rpartition(':')[2].strip('/'))
        connection = HTTPConnection('127.0.0.1', port, timeout=10.0)

        def newest():
            connection.request('GET', '/newest')
            return json.loads(connection.getresponse().read())
        spin(graph, lambda: not newest() and all(it.get_subscription_count() for it, _ in topics))
        seen = []
        sender.create_subscription(Image, 'image/view', seen.append, qos_profile_sensor_data)

        def told_all():
            for publisher, message in topics:
                publisher.publish(message)
            shown = newest() or {}
            return seen and all(shown.get(key) for key in ('image', 'contact', 'status'))
        spin(graph, told_all)
        shown = newest()
        assert shown['status']['reason'] == HOSTILE and shown['position'] is None
        assert shown['contact']['type'] == 'line' and shown['image']['rows'] == 16
        assert shown['contact']['place']['x'] == told['/tactile/contact'].x
        assert seen[0].header.stamp == told['/tactile/image'].header.stamp


def spin(graph, until, seconds=30.0):
    done = []
    graph.spin(lambda: done.append(until()) or done[-1], seconds)
    assert done[-1] or seconds < 30.0
