"""What every byte protocol of the registry must do, whatever its bytes are."""
import numpy as np
import pytest

from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.protocol import Frame, NEED_DATA
from tactile_sensing.devices.registry import protocol_named, PROTOCOLS

ROWS, COLUMNS = 4, 6


@pytest.fixture(params=PROTOCOLS)
def protocol(request):
    return protocol_named(request.param)


def pictures(count, seed=1):
    """Counts as of an unloaded pad: small ones."""
    rng = np.random.default_rng(seed)
    return rng.integers(0, 60, (count, ROWS, COLUMNS)).astype(np.uint8)


def stream(protocol, counts):
    return protocol.preamble + b''.join(protocol.encode(picture) for picture in counts)


def frames_of(decoder, data):
    decoder.receive_data(data)
    frames = []
    while (event := decoder.next_event()) is not NEED_DATA:
        if isinstance(event, Frame):
            frames.append(event)
    assert decoder.buffered <= decoder.buffer_bound
    return frames


def test_what_is_encoded_is_decoded_wherever_it_is_split(protocol):
    counts = pictures(6)
    data = stream(protocol, counts)
    for split in range(len(data) + 1):
        decoder = protocol.decoder(ROWS, COLUMNS)
        frames = frames_of(decoder, data[:split]) + frames_of(decoder, data[split:])
        np.testing.assert_array_equal([frame.counts for frame in frames], counts)
        assert [frame.sequence for frame in frames] == list(range(6))
        assert (decoder.frames, decoder.dropped_bytes, decoder.locked) == (6, 0, True)


@pytest.mark.parametrize('kind', [np.uint8, np.uint16, np.int16])
def test_counts_of_every_converter(protocol, kind):
    bounds = np.iinfo(kind)
    counts = np.random.default_rng(3).integers(
        bounds.min, bounds.max, (6, ROWS, COLUMNS), kind, endpoint=True)
    decoder = protocol.decoder(ROWS, COLUMNS, kind)
    frames = frames_of(decoder, stream(protocol, counts))
    np.testing.assert_array_equal([frame.counts for frame in frames], counts)
    assert decoder.dropped_bytes == 0 and frames[0].counts.dtype == kind


def test_garbage_is_bounded_and_the_stream_is_found_again(protocol):
    decoder = protocol.decoder(ROWS, COLUMNS)
    rng = np.random.default_rng(2)
    for _ in range(50):
        frames_of(decoder, rng.bytes(1000))
    counts = pictures(30)
    found = frames_of(decoder, stream(protocol, counts))
    np.testing.assert_array_equal(found[-1].counts, counts[-1])
    assert decoder.locked and decoder.dropped_bytes > 0


def test_a_reset_forgets_what_was_buffered(protocol):
    decoder = protocol.decoder(ROWS, COLUMNS)
    data = stream(protocol, pictures(5))
    frames_of(decoder, data[:-3])
    decoder.reset()
    assert decoder.buffered == 0 and not decoder.locked
    np.testing.assert_array_equal(
        [frame.counts for frame in frames_of(decoder, data)], pictures(5))


def test_frames_of_another_array_are_explained(protocol):
    decoder = protocol.decoder(ROWS + 1, COLUMNS)
    data = stream(protocol, pictures(20))
    assert frames_of(decoder, data) == []
    assert str(ROWS * COLUMNS) in decoder.explain(data)
    assert protocol.decoder(ROWS, COLUMNS).explain(data) == ''


def test_an_unknown_protocol_is_refused_by_name():
    with pytest.raises(ConfigurationError, match='morse.*flexitac'):
        protocol_named('morse')
