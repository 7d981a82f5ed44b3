"""Requirements for all byte protocols of the table."""
import os
from pathlib import Path
import re
import subprocess
import sys

import numpy as np
import pytest

from tactile_common.errors import ConfigurationError
from tactile_sensing.devices import weiss
from tactile_sensing.devices.lines import CsvDecoder
from tactile_sensing.devices.registry import options_of, protocol_named, PROTOCOLS

# Ten million bytes as a stress run: BYTES=10000000 pytest ...
BYTES = int(os.environ.get('BYTES', 200_000))
OPTIONS = {'csv_lines': ('', 'stamp=us checksum=true'), 'weiss_wts': ('', 'rle=true'),
           'weiss_dsa': ('rle=false', 'cells=200 first=100'), 'robotiq_tsf85': ('', 'finger=1')}
CASES = [(name, text) for name in PROTOCOLS for text in OPTIONS.get(name, ('',))]
# Their checksum detects faults, except one in at least 2^16.
CHECKED = [('csv_lines', 'stamp=us checksum=true'), ('weiss_wts', ''), ('weiss_wts', 'rle=true'),
           ('weiss_dsa', 'rle=false'), ('weiss_dsa', 'cells=200 first=100')]


class Case:
    """A protocol with options, its decoder and its device."""

    def __init__(self, name, text=''):
        self.name, self.protocol, self.options = name, protocol_named(name), options_of(name, text)
        self.shape = self.protocol.shape or (4, 6)

    def decoder(self, shape=None, kind=np.uint8):
        return self.protocol.decoder(*(shape or self.shape), kind, **self.options)

    def device(self):
        device = self.protocol.device(**self.options)
        device.answer(self.decoder().start(100.0))
        assert device.running
        return device

    def images(self, count, seed=1):
        """Return small counts, like those of an unloaded pad."""
        rng = np.random.default_rng(seed)
        return rng.integers(0, 60, (count, *self.shape)).astype(np.uint8)

    def packets(self, counts):
        device = self.device()
        return [device.encode(image, 10_000_000 * k) for k, image in enumerate(counts)]

    def stream(self, counts):
        return self.device().preamble + b''.join(self.packets(counts))


@pytest.fixture(params=CASES, ids='-'.join)
def case(request):
    return Case(*request.param)


def frames_of(decoder, data, size=None):
    frames = []
    for at in range(0, max(len(data), 1), size or max(len(data), 1)):
        decoder.receive_data(data[at:at + size] if size else data)
        frames += iter(decoder.next_frame, None)
        assert decoder.buffered <= decoder.buffer_bound
    return frames


def counts_of(frames):
    return [frame.counts.tolist() for frame in frames]


def test_what_is_encoded_is_decoded_wherever_it_is_split(case):
    counts = case.images(3)
    data = case.stream(counts)
    for split in range(len(data) + 1):
        decoder = case.decoder()
        frames = frames_of(decoder, data[:split]) + frames_of(decoder, data[split:])
        np.testing.assert_array_equal([frame.counts for frame in frames], counts)
        assert [frame.sequence for frame in frames] == [0, 1, 2]
        assert (decoder.frames, decoder.dropped_bytes, decoder.locked) == (3, 0, True)


@pytest.mark.parametrize('kind', [np.uint8, np.uint16, np.int16])
def test_counts_of_every_converter(case, kind):
    bounds = np.iinfo(kind)
    carried = np.iinfo(case.protocol.kind)
    low, high = carried.min, carried.max
    if case.name == 'flexitac':  # bytes or words without any other information
        low, high = -2**15, 2**16
    counts = np.random.default_rng(3).integers(
        max(bounds.min, low), min(bounds.max, high), (6, *case.shape), kind, endpoint=True)
    decoder = case.decoder(kind=kind)
    frames = frames_of(decoder, case.stream(counts))
    np.testing.assert_array_equal([frame.counts for frame in frames], counts)
    assert decoder.dropped_bytes == 0 and frames[0].counts.dtype == kind
    with pytest.raises(ValueError):
        frames[0].counts[0, 0] = 1


def test_garbage_is_bounded_and_the_stream_is_found_again(case):
    decoder = case.decoder()
    rng = np.random.default_rng(2)
    for _ in range(BYTES // 1000):
        frames_of(decoder, rng.bytes(1000))
    counts = case.images(30)
    found = frames_of(decoder, case.stream(counts))
    np.testing.assert_array_equal(found[-1].counts, counts[-1])
    assert decoder.locked and decoder.dropped_bytes > 0


@pytest.mark.parametrize('garbage', [
    b'\xaa', b'\xaa\xaa\xaa\x00', b'\xaa\xaa\xaa\x00\x30\x00', b'\x9a\x00\x58\x3c', b'1,2,3',
    b'1 2 3 \r\n', b'\r\n', b'\n', bytes(40), b'\xff' * 500, bytes(range(256))], ids=repr)
def test_after_garbage_no_clean_frame_but_one_is_lost(case, garbage):
    if case.name == 'flexitac':
        pytest.skip('it has no check: markers must confirm each other, see test_flexitac.py')
    counts = case.images(8)
    packets = case.packets(counts)
    head = case.device().preamble + b''.join(packets[:3]) + garbage
    decoder = case.decoder()
    assert counts_of(frames_of(decoder, head))[:3] == counts[:3].tolist()
    assert counts_of(frames_of(decoder, b''.join(packets[3:])))[-4:] == counts[4:].tolist()


def mutated(rng, data, share):
    """Return bytes of which some are changed, lost or doubled."""
    array = np.frombuffer(data, np.uint8).copy()
    hit = rng.random(array.size) < share
    array[hit] ^= rng.integers(1, 256, hit.sum(), np.uint8)
    times = np.where(rng.random(array.size) < share, rng.choice([0, 2], array.size), 1)
    return np.repeat(array, times).tobytes()


def test_mutated_bytes_never_crash_and_the_stream_is_found_again(case):
    rng = np.random.default_rng(4)
    counts = case.images(100)
    data, decoder, seen = case.stream(counts), case.decoder(), 0
    while seen < BYTES:
        part = mutated(rng, data, rng.choice([0.001, 0.01, 0.1]))
        frames_of(decoder, part, 997)
        seen += len(part)
    found = frames_of(decoder, case.stream(case.images(30, 9)))
    assert found[-1].counts.tolist() == case.images(30, 9)[-1].tolist()


@pytest.mark.parametrize('case', CHECKED, ids='-'.join, indirect=True)
def test_no_frame_of_mutated_bytes_that_fails_its_check(case):
    """With a single fault in each frame, of any kind, every returned frame was sent."""
    rng = np.random.default_rng(5)
    counts = case.images(200)
    sent = {image.tobytes() for image in counts}
    packets, decoder, got, seen = case.packets(counts), case.decoder(), 0, 0
    frames_of(decoder, case.device().preamble)
    while seen < BYTES:
        spoilt = []
        for packet in packets:
            packet, at = bytearray(packet), rng.integers(len(packet))
            match rng.integers(4):
                case 0:
                    packet[at] ^= rng.integers(1, 256)
                case 1:
                    del packet[at:at + rng.integers(1, 9)]
                case 2:
                    packet[at:at] = rng.bytes(rng.integers(1, 9))
            spoilt.append(bytes(packet))
        data = b''.join(spoilt)
        frames = frames_of(decoder, data, 501)
        seen, got = seen + len(data), got + len(frames)
        wrong = [frame for frame in frames if frame.counts.tobytes() not in sent]
        assert wrong == []
    assert got > 0 and decoder.dropped_bytes > 0


def test_frames_that_are_spoilt_are_counted_as_lost(case):
    counts = case.images(60)
    packets = case.packets(counts)
    for k in range(10, 50, 10):  # one byte in the middle of a frame
        spoilt = bytearray(packets[k])
        spoilt[1 if case.name == 'robotiq_tsf85' else len(spoilt) // 2] = 0x78
        if case.name == 'robotiq_tsf85':
            spoilt = spoilt[1:]
        if case.name == 'flexitac':
            del spoilt[5]
        packets[k] = bytes(spoilt)
    decoder = case.decoder()
    frames = frames_of(decoder, case.device().preamble + b''.join(packets))
    assert len(frames) == 56
    assert decoder.frames + decoder.lost_frames == 60
    assert frames[-1].sequence == 59


def test_a_reset_forgets_what_was_buffered(case):
    decoder = case.decoder()
    data = case.stream(case.images(5))
    frames_of(decoder, data[:-3])
    decoder.reset()
    assert decoder.buffered == 0 and not decoder.locked
    assert counts_of(frames_of(decoder, data)) == case.images(5).tolist()


def test_joined_in_the_middle_no_frame_is_cut(case):
    """If reading starts at any byte, the first frame is still complete."""
    counts = case.images(6)
    data = b''.join(case.packets(counts)) + case.device().preamble
    sent = counts.tolist()
    for missed in range(1, len(data) // 6 + 2):
        frames = frames_of(case.decoder(), data[missed:])
        got = counts_of(frames)
        assert got and got == sent[-len(got):] and len(got) >= 4


def test_frames_of_another_array_are_explained(case):
    if case.protocol.shape:
        with pytest.raises(ConfigurationError, match='5x6, of this sensor it is 7x4'):
            case.decoder((5, 6))
        return
    decoder = case.decoder((5, 6))
    data = case.stream(case.images(20))
    if case.options.get('first'):
        data = Case(case.name).stream(case.images(20))
    assert frames_of(decoder, data) == []
    count = 24 + len(case.options) * (case.name == 'csv_lines' and bool(case.options['stamp']))
    assert f' {count} ' in decoder.explain() or ' 4 rows of 6 values' in decoder.explain()
    same = case.decoder()
    frames_of(same, case.stream(case.images(20)))
    assert same.explain() == ''


@pytest.mark.parametrize('bits', [32, 64])
def test_times_of_the_device_go_on_where_its_clock_begins_again(bits):
    decoder = CsvDecoder(1, 2, stamp='us')
    data = b'\n' + b''.join(b'%d,1,2\n' % (tick % 2**bits) for tick in range(2**32 - 2, 2**32 + 3))
    times = [frame.device_ns for frame in frames_of(decoder, data)]
    assert np.diff(times).tolist() == [1000] * 4


@pytest.mark.parametrize('line', [
    b'1,2,3,4', b'1\t2\t3\t4', b'[1, 2, 3, 4]', b'1;2;3;4;', b' 1 2 3 4 ', b'1.0 2 2.9 4.2',
    b'<1|2|3|4>\r', b'{1:2:3:4}'])
def test_numbers_with_any_separator(line):
    frame, = frames_of(CsvDecoder(2, 2), b'\n' + line + b'\n')
    assert frame.counts.tolist() == [[1, 2], [3, 4]]


@pytest.mark.parametrize('line', [
    b'1,2,3', b'1,2,3,4,5', b'1,2,3,x', b'1,2,3,4e', b'1,2,3,nan', b'1,2,3,inf', b'1,2,3,256',
    b'1,2,3,-1', b'A0=1 2 3 4', b'1,2,3,4_5', b'1,2,3,1e400', b'1-2,3,4,5'])
def test_lines_that_are_no_frame(line):
    decoder = CsvDecoder(2, 2)
    assert frames_of(decoder, b'\n' + line + b'\n') == []
    assert decoder.dropped_bytes == len(line) + 1


@pytest.mark.parametrize('data, options, reason', [
    (b'A0=1,A1=2\n', {}, "lines must hold numbers alone, this one does not: b'A0=1,A1=2'"),
    (b'1,2,3\n', {}, 'a line holds 3 numbers, must hold 2x2 = 4: see the options `stamp`'),
    (b'1,2,3,4\n', {'stamp': 'us'}, 'holds 4 numbers, must hold 2x2 = 4, a stamp: see'),
    (b'1,2,3,4\n', {'checksum': True}, 'must hold 2x2 = 4, a checksum: see'),
    (b'1,2,3,4,5\n', {'checksum': True}, 'is not the sum of the others modulo 65536'),
    (b'1,2,3,400\n', {}, 'a value of 400 is no uint8: see `bits` and `signed`'),
    (b'1,2,3,4,' * 99, {}, r"no end of a frame \(b'.n'\) in 792 bytes, such as b'1,2,3,4,1,2")])
def test_lines_that_are_no_frame_are_explained(data, options, reason):
    decoder = CsvDecoder(2, 2, **options)
    assert frames_of(decoder, b'\n' + data) == []
    assert re.search(reason, decoder.explain()), decoder.explain()


def test_a_line_without_end_is_dropped_and_its_rest_is_no_frame():
    decoder = CsvDecoder(2, 2)
    assert frames_of(decoder, b'\n' + b'9,' * decoder.buffer_bound, 100) == []
    assert frames_of(decoder, b'1,2,3,4\n') == []
    frame, = frames_of(decoder, b'5,6,7,8\n')
    assert frame.counts.tolist() == [[5, 6], [7, 8]]


def test_checksum_is_the_sum_of_all_other_numbers():
    decoder = CsvDecoder(1, 2, np.int32, stamp='ms', checksum=True)
    first, second = frames_of(decoder, b'\n70000,-1,5,4468\n70010,0,65535,4473\n70020,1,1,9\n')
    assert first.counts.tolist() == [[-1, 5]] and second.counts.tolist() == [[0, 65535]]
    assert second.device_ns - first.device_ns == 10_000_000
    assert decoder.check_errors == 1


def test_crc_and_packets_of_weiss():
    """Worked values: the check string, and three packets of the manual's form."""
    assert weiss.crc16(b'123456789') == 0x6EB4
    for text, crc in (('AAAAAA010000', 'E810'), ('AAAAAA0102001234', '6D66'),
                      ('AAAAAA060000', '9726')):  # the CRC as it is sent, low byte first
        data = bytes.fromhex(text)
        assert weiss.packet(data[3], data[6:]) == data + bytes.fromhex(crc)
    assert weiss.packet(6, dsa=True) == bytes.fromhex('AAAAAA060000')
    assert weiss.WeissDecoder(4, 6).start(100.0)[:-2] == bytes.fromhex('AAAAAA210300000A00')
    assert weiss.DsaDecoder(4, 6, rle=True).start(30.0)[:-2] == bytes.fromhex('AAAAAA030300811E00')


def test_run_lengths_are_twelve_bits_of_value_and_four_of_how_often():
    words = np.array([0xF000, 0x2000, 0x2FFF, 0x1007], '<u2').tobytes()
    payload = bytes.fromhex('0A000000 01') + words  # 10 ms, run-length coded
    frame, = frames_of(weiss.WeissDecoder(4, 5), weiss.packet(weiss.FRAME, payload))
    assert frame.counts.ravel().tolist() == [0] * 17 + [4095, 4095, 7]


def test_commands_are_answered_and_refusals_explained():
    device, decoder = weiss.WeissDevice(), weiss.WeissDecoder(4, 6)
    commands = decoder.start(100.0) + weiss.packet(0x77)
    answer = device.answer(commands[:9]) + device.answer(commands[9:])
    decoder.receive_data(answer)
    assert decoder.next_frame() is None
    assert [(command, payload[0]) for command, payload in decoder.replies] == [
        (0x21, 0), (0x77, weiss.NO_COMMAND)]
    assert '0x77 with status 4' in decoder.explain()
    assert device.running
    assert frames_of(decoder, device.encode(np.zeros((4, 6), int)))
    assert decoder.explain() == ''
    device.answer(decoder.stop())
    assert not device.running


def test_a_tag_of_a_finger():
    case = Case('robotiq_tsf85', 'finger=1')
    counts = case.images(1).astype(np.uint16) * 1000
    # A packet: start, no CRC, command, size, tag of finger 1, values; then a temperature.
    frame, = frames_of(
        case.decoder(kind=np.uint16), b'\x9a\x00\x58\x39\x14' + counts.astype('>u2').tobytes()
        + b'\x9a\x00\x58\x03\x64\x00\x24')
    assert frame.counts.tolist() == counts[0].tolist()


@pytest.mark.parametrize('name, text, reason', [
    ('csv_lines', 'stamp=s', 'stamp is .s., must be one of ms, us'),
    ('csv_lines', 'checksum=7', 'option checksum is .7., must be of the type bool'),
    ('csv_lines', 'sum=1', 'csv_lines has no option .sum., there are: stamp, checksum'),
    ('flexitac', 'a=1', 'there are: none'),
    ('weiss_wts', 'first=10 cells=12', 'first is 10, must be from 0 to -12 of 12 cells'),
    ('robotiq_tsf85', 'finger=5', 'finger is 5, must be 0 or 1'),
    ('robotiq_tsf85', {'finger': 0.7}, 'option finger is 0.7, must be of the type int')])
def test_options_that_are_wrong(name, text, reason):
    row = protocol_named(name)
    with pytest.raises(ConfigurationError, match=reason):
        row.decoder(*(row.shape or (4, 6)), np.uint16, **options_of(name, text))


# Another package adds a protocol by an entry point.
EXAMPLE = Path(__file__).parent / 'example_protocol'
PROGRAM = """
import numpy as np
from tactile_sensing.devices.registry import protocol_named, PROTOCOLS
from tactile_sensing.nodes.driver import DriverConfig
assert PROTOCOLS[-1] == 'hex_lines' and 'flexitac' in PROTOCOLS
row = protocol_named('hex_lines')
DriverConfig(port='x', protocol='hex_lines')
decoder, device = row.decoder(2, 3), row.device()
counts = np.arange(6, dtype=np.uint8).reshape(2, 3)
decoder.receive_data(device.preamble + device.encode(counts))
print(decoder.next_frame().counts.tolist())
"""


@pytest.fixture(scope='module')
def installed(tmp_path_factory):
    """Provide the entry points and modules of the example, as if it were installed."""
    folder = tmp_path_factory.mktemp('installed')
    subprocess.run([sys.executable, 'setup.py', '-q', 'egg_info', '--egg-base', str(folder)],
                   cwd=EXAMPLE, check=True, capture_output=True)
    return [str(folder), str(EXAMPLE)]


def run(program, paths):
    return subprocess.run(
        [sys.executable, '-c', program], text=True, capture_output=True, check=False,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join([*paths, os.environ['PYTHONPATH']])})


def test_its_protocol_is_in_the_table_and_named_if_it_cannot_be_loaded(installed):
    done = run(PROGRAM, installed)
    assert done.stdout == '[[0, 1, 2], [3, 4, 5]]\n', done.stderr
    program = "from tactile_sensing.devices import registry as r; r.protocol_named('hex_lines')"
    done = run(program, installed[:1])
    assert 'ConfigurationError: protocol hex_lines cannot be loaded: No module' in done.stderr


def test_bytes_between_frames_are_counted():
    case = Case('csv_lines')
    decoder = case.decoder()
    first, second = case.packets(case.images(2))
    assert len(frames_of(decoder, b'\n' + first + b'boot\n' + second)) == 2
    assert (decoder.dropped_bytes, decoder.lost_frames) == (5, 1)


def test_an_unknown_protocol_is_refused_by_name():
    with pytest.raises(ConfigurationError, match='morse.*flexitac'):
        protocol_named('morse')
