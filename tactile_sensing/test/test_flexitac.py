"""FlexiTac decoder, besides the tests of all protocols: garbage, losses, mimics of the marker."""
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from tactile_sensing.devices.flexitac import FlexiTacDecoder, FlexiTacDevice, MARKER, MOST_PERIODS

ROWS, COLUMNS = 3, 4
SIZE = ROWS * COLUMNS
PERIOD = len(MARKER) + SIZE


def picture(value):
    """Return an image without markers, different for every value below 100."""
    return (np.arange(SIZE, dtype=np.uint8) + value).reshape(ROWS, COLUMNS) % 128


def encode_frame(counts):
    return MARKER + FlexiTacDevice().encode(counts)[:-len(MARKER)]


PICTURES = [picture(k) for k in range(6)]
STREAM = b''.join(encode_frame(counts) for counts in PICTURES) + MARKER


def drain(decoder):
    events = list(iter(decoder.next_frame, None))
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
    assert encode_frame(counts[:, ::-1]) == MARKER + b'\x02\x01\x00\x05\x04\x03'


def test_in_lock_a_frame_waits_for_the_next_marker_only():
    decoder, _ = decode([STREAM])
    decoder.receive_data(FlexiTacDevice().encode(picture(50))[:-1])
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
        assert decoder.locked


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


@pytest.mark.parametrize('first', [0, 2], ids=['at a marker', 'within a frame'])
@pytest.mark.parametrize('offset', range(SIZE - 1))
def test_tactels_that_hold_the_marker_differ_by_their_noise(offset, first):
    pictures = []
    for k in range(MOST_PERIODS):
        counts = picture(k).ravel()
        counts[offset:offset + 2] = tuple(MARKER)
        counts[offset] ^= k == MOST_PERIODS - 3
        pictures.append(counts.reshape(ROWS, COLUMNS))
    stream = b''.join(map(encode_frame, pictures)) + MARKER
    _, events = decode(stream[k:k + 1] for k in range(first, len(stream)))
    assert pictures_of(events) == as_lists(pictures[first > 0:])


def test_where_the_start_of_a_frame_is_not_clear_there_is_no_frame():
    counts = np.frombuffer((MARKER * SIZE)[:SIZE], np.uint8).reshape(ROWS, COLUMNS)
    decoder, events = decode([encode_frame(counts) * 50])
    assert events == [] and 'hold the values 170, 85 of the marker' in decoder.explain()
    decoder.receive_data(STREAM)
    assert pictures_of(drain(decoder))[-len(PICTURES):] == as_lists(PICTURES)
    assert decoder.explain() == ''


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


@settings(max_examples=100, derandomize=True)
@given(data=st.data())
def test_any_pictures_come_back_from_any_pieces(data):
    rows, columns = data.draw(st.tuples(st.integers(1, 5), st.integers(1, 5)))
    value = st.sampled_from([0, 1, 0x55, 0xaa, 255])
    payload = st.lists(value, min_size=rows * columns, max_size=rows * columns)
    payloads = data.draw(st.lists(payload, min_size=8, max_size=12))
    stream = b''.join(MARKER + bytes(payload) for payload in payloads) + MARKER
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    edges = [0, *cuts, len(stream)]
    decoder, events = decode(
        [stream[a:b] for a, b in zip(edges[:-1], edges[1:], strict=True)], rows, columns)
    got = [event.counts.tobytes() for event in events]
    if stream.count(MARKER) == len(payloads) + 1:
        assert got == [bytes(payload) for payload in payloads] and decoder.dropped_bytes == 0
    assert got == [bytes(payload) for payload in payloads][len(payloads) - len(got):]


@settings(max_examples=100, derandomize=True)
@given(garbage=st.binary(max_size=200), cut=st.integers(0, PERIOD))
def test_no_byte_is_unaccounted_for(garbage, cut):
    stream = garbage + STREAM[cut:]
    decoder, events = decode([stream])
    used = decoder.frames * PERIOD + decoder.dropped_bytes + decoder.buffered
    assert used == len(stream)
    assert pictures_of(events)[-4:] == as_lists(PICTURES[-4:])


@pytest.mark.parametrize('sent, kind, hint', [
    (np.uint16, np.uint8, 'sends 24 bytes a frame, 12 are expected: it sends two a tactel, `bits` '
     'of the calibration must be above 8'),
    (np.uint8, np.uint16, 'sends 12 bytes a frame, 24 are expected: it sends one a tactel, `bits` '
     'of the calibration must be at most 8')])
def test_counts_of_another_width_are_explained(sent, kind, hint):
    decoder = FlexiTacDecoder(ROWS, COLUMNS, kind)
    decoder.receive_data(encode_frame(picture(5).astype(sent)) * 40)
    assert drain(decoder) == [] and hint in decoder.explain()


def test_the_size_of_other_frames_is_explained():
    rng = np.random.default_rng(2)
    frames = [encode_frame(rng.integers(0, 256, (12, 32), np.uint8)) for _ in range(40)]
    decoder, _ = decode([b''.join(frames)])
    assert decoder.explain() == 'the sensor sends 384 bytes a frame, 12 are expected'
    for data in (rng.bytes(16384), bytes(16384), b'', STREAM):
        assert decode([data])[0].explain() == ''


@pytest.mark.parametrize('place', [0, 17, 127, 254])
def test_lost_bytes_while_tactels_hover_about_the_marker(place):
    """No image is out of phase, and few are lost, unless a loss brings them to the marker."""
    rng = np.random.default_rng(place)
    frames = rng.integers(8, 13, (600, 16, 16), np.uint8)
    frames.reshape(600, -1)[:, place:place + 2] = np.frombuffer(MARKER, np.uint8)
    frames.reshape(600, -1)[:, place] -= rng.random(600) < 0.3
    stream = bytearray(b''.join(map(encode_frame, frames)) + MARKER)
    losses = range(590 * 258 - 40, 30 * 258, -30 * 258)
    for at in losses:
        at += int(rng.integers(0, 258))
        del stream[at:at + int(rng.choice([1, 5, 60]))]
    cuts = np.sort(rng.integers(0, len(stream), 800)).tolist()
    _, events = decode([bytes(stream[a:b]) for a, b in zip(
        [0, *cuts], [*cuts, len(stream)], strict=True)], 16, 16)
    sent = {counts.tobytes() for counts in frames}
    got = [event.counts.tobytes() for event in events]
    assert set(got) <= sent and len(got) >= 600 - 3 * len(losses)


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


@pytest.mark.parametrize('kind', ['markers', 'first halves', 'runs'])
def test_bait_is_discarded(kind):
    """Bytes that look like frames again and again make none, and the buffer is bounded."""
    period, size, rng = 258, 20_000, np.random.default_rng(5)
    data = bytearray(rng.integers(0, 128, size, np.uint8).tobytes())
    if kind == 'runs':  # two markers a period apart, everywhere
        for start in range(0, size - 3 * period, 3 * period):
            for place in range(start, start + period, 2):
                data[place:place + 2] = data[place + period:place + period + 2] = MARKER
    else:
        data[:] = ((MARKER if kind == 'markers' else MARKER[:1]) * size)[:size]
    decoder, events = decode((bytes(data[k:k + 64]) for k in range(0, size, 64)), 16, 16)
    assert events == [] and decoder.dropped_bytes + decoder.buffered == size
