"""FlexiTac decoder, besides the tests of all protocols: garbage, losses, mimics, bait."""
import sys

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.flexitac import (
    AMBIGUOUS_PERIODS,
    encode_payload,
    FlexiTacDecoder,
    FlexiTacDevice,
    MARKER,
)

ROWS, COLUMNS = 3, 4
SIZE = ROWS * COLUMNS
PERIOD = len(MARKER) + SIZE


def picture(value):
    """Return an image without markers, different for every value below 100."""
    return (np.arange(SIZE, dtype=np.uint8) + value).reshape(ROWS, COLUMNS) % 128


def encode_frame(counts):
    return MARKER + encode_payload(counts)


PICTURES = [picture(k) for k in range(6)]
STREAM = b''.join(encode_frame(counts) for counts in PICTURES) + MARKER


def drain(decoder):
    events = list(iter(decoder.next_event, None))
    assert decoder.buffered <= decoder.buffer_bound
    return events


def decode(chunks, rows=ROWS, columns=COLUMNS):
    decoder = FlexiTacDecoder(rows, columns)
    events = []
    for chunk in chunks:
        decoder.receive_data(chunk)
        events += drain(decoder)
    return decoder, events


def pictures_of(events):
    return [event.counts.tolist() for event in events]


def as_lists(pictures):
    return [counts.tolist() for counts in pictures]


def test_frame_is_marker_and_row_major_payload():
    counts = np.arange(6, dtype=np.uint8).reshape(2, 3)
    assert encode_frame(counts) == b'\xaa\x55\x00\x01\x02\x03\x04\x05'
    assert FlexiTacDevice().encode(counts) == b'\x00\x01\x02\x03\x04\x05\xaa\x55'
    assert encode_payload(counts[:, ::-1]) == b'\x02\x01\x00\x05\x04\x03'


def test_in_lock_a_frame_waits_for_the_next_marker_only():
    decoder, _ = decode([STREAM])
    following = encode_payload(picture(50))
    decoder.receive_data(following + MARKER[:1])
    assert drain(decoder) == []
    decoder.receive_data(MARKER[1:])
    assert pictures_of(drain(decoder)) == as_lists([picture(50)])


GARBAGE = {
    'one byte': b'\x00',
    'half a marker': MARKER[:1],
    'the other half': MARKER[1:],
    'a marker': MARKER,
    'markers': MARKER * 2,
    'more than a frame': bytes(range(100)),
    'end of a frame': STREAM[5:PERIOD],
    'first halves': MARKER[:1] * 30,
}


@pytest.mark.parametrize('garbage', GARBAGE.values(), ids=GARBAGE.keys())
@pytest.mark.parametrize('chunk', [1, 7, 1000])
@pytest.mark.parametrize('place', ['before', 'between', 'inside', 'after'])
def test_garbage(garbage, chunk, place):
    at = {'before': 0, 'between': 3 * PERIOD, 'inside': 2 * PERIOD + 6, 'after': len(STREAM)}
    stream = STREAM[:at[place]] + garbage + STREAM[at[place]:]
    decoder, events = decode(stream[k:k + chunk] for k in range(0, len(stream), chunk))
    # Garbage between two frames hides the marker that confirms the first frame. Garbage that is
    # the begin or end of a marker does not change the stream.
    lost = {'before': [], 'between': [2], 'inside': [2], 'after': []}[place]
    if place == 'between' and garbage.startswith(MARKER):
        lost = []
    expected = [counts for k, counts in enumerate(PICTURES) if k not in lost]
    assert pictures_of(events) == as_lists(expected)
    if place != 'after':
        assert decoder.dropped_bytes == len(garbage) + len(lost) * PERIOD
        assert decoder.resyncs == 1 and decoder.locked


@pytest.mark.parametrize('missing', range(1, 2 * PERIOD, 2))
@pytest.mark.parametrize('at', range(2 * PERIOD + 2, 3 * PERIOD, 4))
def test_lost_bytes(at, missing):
    stream = STREAM[:at] + STREAM[at + missing:-len(MARKER)] + STREAM
    _, events = decode([stream[:70], stream[70:]])
    whole = as_lists(PICTURES)
    # Only frames that were sent are returned, unless a loss of whole periods joins two halves,
    # which cannot be detected without a checksum.
    if missing % PERIOD:
        assert all(counts in whole for counts in pictures_of(events))
    assert pictures_of(events)[:2] == whole[:2]
    assert pictures_of(events)[-6:] == whole
    sequences = [event.sequence for event in events]
    assert sequences == sorted(set(sequences))


@pytest.mark.parametrize('offset', range(SIZE - 1))
def test_marker_in_every_payload_at_one_place(offset):
    """The worst case: an image that contains the marker and hardly changes."""
    pictures = []
    for k in range(AMBIGUOUS_PERIODS + 4):
        counts = picture(k).ravel()
        counts[offset:offset + 2] = tuple(MARKER)
        pictures.append(counts.reshape(ROWS, COLUMNS))
    stream = b''.join(map(encode_frame, pictures)) + MARKER
    assert pictures_of(decode([stream])[1]) == as_lists(pictures)
    # If reading starts within a frame, the mimic comes first; noise reveals it.
    pictures[AMBIGUOUS_PERIODS - 2].ravel()[offset] ^= 1
    stream = b''.join(map(encode_frame, pictures)) + MARKER
    _, events = decode(stream[k:k + 1] for k in range(2, len(stream)))
    assert pictures_of(events) == as_lists(pictures[1:])


@pytest.mark.parametrize('rows, columns', [(4, 4), (3, 3), (16, 16)])
def test_payload_of_nothing_but_markers(rows, columns):
    payload = (MARKER * (rows * columns))[:rows * columns]
    counts = np.frombuffer(payload, np.uint8).reshape(rows, columns)
    count = AMBIGUOUS_PERIODS + 2
    stream = encode_frame(counts) * count + MARKER
    _, events = decode([stream], rows, columns)
    assert pictures_of(events) == [counts.tolist()] * count


def test_mimic_of_a_boundary_at_the_right_distance():
    """After a loss, a payload with markers at the right distance must not start a frame."""
    mimic = picture(0).ravel()
    mimic[4:6] = tuple(MARKER)
    clean = [picture(k) for k in range(1, 6)]
    first = encode_frame(mimic.reshape(ROWS, COLUMNS))
    # Two consecutive mimics confirm one period, which is not sufficient for a lock.
    stream = STREAM[:3 * PERIOD] + b'\x01' + first + first
    stream += b''.join(map(encode_frame, clean)) + MARKER
    expected = as_lists(PICTURES[:2] + [mimic.reshape(ROWS, COLUMNS)] * 2 + clean)
    assert pictures_of(decode([stream])[1]) == expected


@settings(max_examples=200, deadline=None, derandomize=True)
@given(data=st.data())
def test_any_pictures_come_back_from_any_pieces(data):
    rows, columns = data.draw(st.tuples(st.integers(1, 5), st.integers(1, 5)))
    value = st.sampled_from([0, 1, 0x55, 0xaa, 255])
    payload = st.lists(value, min_size=rows * columns, max_size=rows * columns)
    payloads = data.draw(st.lists(payload, min_size=AMBIGUOUS_PERIODS, max_size=12))
    stream = b''.join(MARKER + bytes(payload) for payload in payloads) + MARKER
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    edges = [0, *cuts, len(stream)]
    decoder, events = decode(
        [stream[a:b] for a, b in zip(edges[:-1], edges[1:], strict=True)], rows, columns)
    got = [event.counts.tobytes() for event in events]
    assert got == [bytes(payload) for payload in payloads]
    assert decoder.dropped_bytes == 0


@settings(max_examples=100, deadline=None, derandomize=True)
@given(garbage=st.binary(max_size=200), cut=st.integers(0, PERIOD))
def test_no_byte_is_unaccounted_for(garbage, cut):
    stream = garbage + STREAM[cut:]
    decoder, events = decode([stream])
    used = decoder.frames * PERIOD + decoder.dropped_bytes + decoder.buffered
    assert used == len(stream)
    assert pictures_of(events)[-4:] == as_lists(PICTURES[-4:])


def test_random_bytes_make_no_frame():
    """Random bytes of 5 s at 2 Mbaud: no frame, no growing buffer, then a clean start."""
    rng = np.random.default_rng(1)
    decoder = FlexiTacDecoder(16, 16)
    for _ in range(250):
        decoder.receive_data(rng.bytes(4000))
        assert drain(decoder) == []
    assert decoder.dropped_bytes + decoder.buffered == 1_000_000
    counts = np.full((16, 16), 7, np.uint8)
    decoder.receive_data(encode_frame(counts) * 4 + MARKER)
    assert pictures_of(drain(decoder)) == [counts.tolist()] * 4


@pytest.mark.parametrize('rows, columns', [(0, 4), (4, -1), (4.0, 4), ('4', 4)])
def test_impossible_size(rows, columns):
    with pytest.raises(ConfigurationError, match='at least 1'):
        FlexiTacDecoder(rows, columns)


def test_the_size_of_other_frames_is_told():
    rng = np.random.default_rng(2)
    frames = [encode_frame(rng.integers(0, 256, (12, 32), np.uint8)) for _ in range(40)]
    decoder, _ = decode([b''.join(frames)])
    assert decoder.explain() == 'the sensor sends 384 bytes a frame, 12 are expected'
    for data in (rng.bytes(16384), bytes(16384), b'', STREAM):
        assert decode([data])[0].explain() == ''


def stuck(rng, place, count, shape=(16, 16), smooth=True):
    """Return images in which two stuck tactels mimic the marker; others are noise or random."""
    low, high = (8, 13) if smooth else (0, 256)
    frames = rng.integers(low, high, (count, *shape), np.uint8)
    frames.reshape(count, -1)[:, place:place + 2] = tuple(MARKER)
    return frames


@pytest.mark.parametrize('smooth', [True, False], ids=['free pad', 'anything'])
@pytest.mark.parametrize('place', [0, 17, 100, 127, 200, 254])
def test_tactels_stuck_at_the_marker_and_lost_bytes(place, smooth):
    """No image is out of phase, and few are lost, because earlier frames show the start."""
    rng = np.random.default_rng(place)
    # At 127, half a period, both phases look alike, and the nearer one is chosen.
    most = 100 if place == 127 else 250
    frames = stuck(rng, place, 600, smooth=smooth)
    stream = bytearray(b''.join(map(encode_frame, frames)) + MARKER)
    losses = 0
    for at in range(590 * 258 - 40, 30 * 258, -30 * 258):
        lost = int(rng.choice([1, 1, 2, 5, 60, int(rng.integers(1, most))]))
        at += int(rng.integers(0, 258))
        del stream[at:at + lost]
        losses += 1
    chunks, at = [], 0
    while at < len(stream):
        size = int(rng.integers(1, 400))
        chunks.append(bytes(stream[at:at + size]))
        at += size
    _, events = decode(chunks, 16, 16)
    sent = {counts.tobytes() for counts in frames}
    got = [event.counts.tobytes() for event in events]
    assert not [payload for payload in got if payload not in sent]
    assert len(got) >= 600 - 3 * losses


@pytest.mark.parametrize('place', [4, 100, 201])
def test_a_loss_that_brings_the_mimic_to_the_marker_ends_the_lock(place):
    rng = np.random.default_rng(3)
    frames = stuck(rng, place, 60)
    for at in range(20 * 258 + 2, 21 * 258 - place - 2, 40):  # within one picture
        stream = b''.join(map(encode_frame, frames)) + MARKER
        stream = stream[:at] + stream[at + place + len(MARKER):]
        sent = {counts.tobytes() for counts in frames}
        _, events = decode([stream], 16, 16)
        got = [event.counts.tobytes() for event in events]
        assert set(got) <= sent and len(got) >= 57


def test_pauses_tell_where_a_frame_starts():
    """Two tactels are stuck from the start: the ends of reads show where a device pauses."""
    frames = stuck(np.random.default_rng(4), 100, 40)
    first = encode_payload(frames[0])[50:] + MARKER
    _, events = decode([first, *map(FlexiTacDevice().encode, frames[1:])], 16, 16)
    assert pictures_of(events) == as_lists(frames[1:])


def bait(kind, period, rng):
    """Return twenty thousand bytes that repeatedly look like frames, but are not."""
    size = 20_000
    if kind == 'markers':
        return (MARKER * size)[:size]
    if kind == 'first halves':
        return MARKER[:1] * size
    data = bytearray(rng.integers(0, 256, size, np.uint8).tobytes())
    for start in range(0, size - 12 * period, 12 * period + 5):
        # Runs of markers everywhere that break one period before they would be accepted.
        for place in range(0, period - 1, 2 if kind == 'runs' else 9):
            for k in range({'runs': 2, 'long runs': 7}[kind]):
                data[start + k * period + place:start + k * period + place + 2] = MARKER
    return bytes(data)


def calls(function):
    """Count the function calls, including built-in functions, that a function makes."""
    count = 0

    def step(_, event, __):
        nonlocal count
        count += event in ('call', 'c_call')

    sys.setprofile(step)
    try:
        function()
    finally:
        sys.setprofile(None)
    return count


@pytest.mark.parametrize('chunk', [1, 64])
@pytest.mark.parametrize('kind', ['markers', 'first halves', 'runs', 'long runs'])
def test_bait_costs_no_more_per_byte_however_long_a_frame_is(kind, chunk):
    costs = []
    for rows, columns in ((8, 8), (32, 32)):
        data = bait(kind, 2 + rows * columns, np.random.default_rng(5))
        pieces = [data[k:k + chunk] for k in range(0, len(data), chunk)]
        costs.append(calls(lambda p=pieces, r=rows, c=columns: decode(p, r, c)) / len(data))
    # Six calls per byte are those of the test, which passes single bytes.
    assert max(costs) < 30.0
    assert costs[1] < 1.3 * costs[0] + 1.0
