"""Every fault of the line in every protocol: nothing valid from corrupt data, and soon back."""
import numpy as np
import pytest

from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.frame_clock import FrameClock
from tactile_sensing.devices.registry import options_of, protocol_named, PROTOCOLS
from tactile_simulation.line_faults import LineFaults

RATE = 100.0  # Hz
FAULTS = ('flip=0.002', 'lose=0.002', 'garbage=0.3', 'cut=0.3', 'drop=0.3')
# Where bytes have a checksum, those of no other frame come out.
CHECKED = {'csv_lines': 'stamp=us checksum=true', 'weiss_wts': 'rle=true', 'weiss_dsa': ''}


@pytest.mark.parametrize('fault', FAULTS)
@pytest.mark.parametrize('protocol', PROTOCOLS)
def test_a_fault_that_ends(protocol, fault):
    row, options = protocol_named(protocol), options_of(protocol, CHECKED.get(protocol, ''))
    shape, rng = row.shape or (8, 8), np.random.default_rng(3)
    device, faults, none = row.device(**options), LineFaults.from_text(fault), LineFaults()
    decoder = row.decoder(*shape, np.uint8, **options)
    device.answer(decoder.start(RATE))
    clock, sent, got = FrameClock(decoder, RATE), {}, []
    clock.receive(device.preamble, 0)
    for k in range(600):
        counts = rng.integers(0, 60, shape, np.uint8)
        sent[counts.tobytes()] = k
        data = (faults if 100 <= k < 400 else none).spoil(
            device.encode(counts, k * 10_000_000), rng)
        got += [(k, frame) for frame in clock.receive(data, (k + 1) * 10_000_000)]
        assert decoder.buffered <= decoder.buffer_bound
    wrong = [frame for _, frame in got if frame.counts.tobytes() not in sent]
    if protocol in CHECKED:
        assert wrong == []
    # All frames of the first second without faults, and of the last but one.
    for first, last in ((0, 98), (500, 600)):
        fresh = {sent[frame.counts.tobytes()] for k, frame in got
                 if first <= k and frame.counts.tobytes() in sent}
        assert fresh >= set(range(first, last))
    # Where the device's clock tells, what was sent was published or is counted as lost.
    if protocol in CHECKED:
        assert len(got) + clock.stalled == decoder.frames
        assert decoder.frames + decoder.lost_frames == 600
    elif fault != 'drop=0.3' and protocol != 'robotiq_tsf85':
        assert decoder.lost_frames > 0


@pytest.mark.parametrize('text, reason', [
    ('flap=1', "fault 'flap' is unknown, there are: flip, lose"), ('flip', 'fault flip is -1'),
    ('flip=2', 'fault flip is 2.0, must be between 0 and 1')])
def test_wrong_words(text, reason):
    with pytest.raises(ConfigurationError, match=reason):
        LineFaults.from_text(text)


def test_without_faults_nothing_changes():
    data = bytes(range(256))
    assert LineFaults().spoil(data, np.random.default_rng(0)) == data
