"""Stamps of frames from the times of reads: stalls, bursts, floods; no clock is read."""
from itertools import groupby

import numpy as np
import pytest

from tactile_sensing.devices.flexitac import FlexiTacDecoder, FlexiTacDevice, MARKER
from tactile_sensing.devices.frame_clock import BURST, FrameClock, RATE_MARGIN, STALL_PERIODS
from tactile_sensing.devices.lines import CsvDecoder, CsvDevice

encode_next = FlexiTacDevice().encode

SHAPE = (4, 5)
RATE = 200.0
PERIOD = 5_000_000  # ns
NOON = 1_700_000_000_000_000_000


def picture(value):
    return np.full(SHAPE, value % 128, np.uint8)


@pytest.fixture
def clock():
    """Return a clock in lock, with the last frame at NOON."""
    clock = FrameClock(FlexiTacDecoder(*SHAPE), RATE)
    clock.receive(MARKER, NOON - 21 * PERIOD)
    for k in range(21):
        clock.receive(encode_next(picture(k)), NOON - (20 - k) * PERIOD)
    assert clock.decoder.frames == 21
    return clock


def test_a_frame_that_comes_whole_has_the_time_of_its_read_after_a_pause_too(clock):
    (stamped,) = clock.receive(encode_next(picture(50)), NOON + PERIOD)
    assert stamped.stamp_ns == NOON + PERIOD
    np.testing.assert_array_equal(stamped.counts, picture(50))
    (stamped,) = clock.receive(encode_next(picture(50)), NOON + 3_000_000_000)
    assert stamped.stamp_ns == NOON + 3_000_000_000


def test_frames_read_at_once_are_a_period_apart(clock):
    data = b''.join(encode_next(picture(k)) for k in range(4))
    times = [frame.stamp_ns for frame in clock.receive(data, NOON + 4 * PERIOD)]
    np.testing.assert_allclose(np.array(times) - NOON, PERIOD * np.arange(1, 5), atol=1000)


@pytest.mark.parametrize('stall', [1, 2, 2.9])
def test_a_short_stall_makes_a_frame_older_not_younger(clock, stall):
    data = encode_next(picture(50))
    assert clock.receive(data[:7], NOON + PERIOD) == []
    (stamped,) = clock.receive(data[7:], NOON + PERIOD + round(stall * PERIOD))
    assert stamped.stamp_ns == NOON + PERIOD
    assert clock.stalled == 0


@pytest.mark.parametrize('seconds', [STALL_PERIODS / RATE, 0.1, 3.0, 3600.0])
def test_a_frame_that_stalls_in_the_middle_is_not_given(clock, seconds):
    data, later = encode_next(picture(50)), NOON + PERIOD + round(seconds * 1e9)
    clock.receive(data[:7], NOON + PERIOD)
    assert clock.receive(data[7:], later) == []
    assert clock.stalled == 1
    (stamped,) = clock.receive(encode_next(picture(51)), later + PERIOD)
    assert stamped.stamp_ns == later + PERIOD


def test_a_reader_that_comes_late_is_no_stall_of_the_sensor(clock):
    """The rest of a frame is read together with the frames that arrived meanwhile."""
    data = b''.join(encode_next(picture(k)) for k in range(13))
    clock.receive(data[:7], NOON + PERIOD)
    got = clock.receive(data[7:], NOON + 13 * PERIOD)
    assert len(got) == 13 and clock.stalled == 0
    np.testing.assert_allclose([frame.stamp_ns - NOON for frame in got],
                               PERIOD * np.arange(1, 14), atol=10_000)


def test_a_slow_line_is_not_a_stall():
    """Bytes arrive one by one over the whole period: the stamp is that of the last byte."""
    clock, got = FrameClock(FlexiTacDecoder(*SHAPE), RATE), []
    for k, byte in enumerate(MARKER + b''.join(encode_next(picture(n)) for n in range(200))):
        got += clock.receive(bytes([byte]), NOON + k * PERIOD // 22)
    assert len(got) == 200 and clock.stalled == 0
    ends = NOON + (1 + 22 * np.arange(1, 201)) * PERIOD // 22
    assert np.abs(np.array([frame.stamp_ns for frame in got]) - ends)[50:].max() < 0.1 * PERIOD


@pytest.mark.parametrize('per_read', [1, 40])
def test_a_flood_is_thinned(clock, per_read):
    """A sensor of 200 Hz sends 8,300 images per second."""
    got, total = 0, 8300
    for k in range(0, total, per_read):
        data = b''.join(encode_next(picture(n)) for n in range(k, k + per_read))
        seconds = 1e-9 * PERIOD + k / 8300  # since the last frame of the fixture
        got += len(clock.receive(data, NOON + round(1e9 * seconds)))
    assert got <= (seconds + BURST) * RATE_MARGIN * RATE
    assert clock.thinned >= total - (1.0 + BURST) * RATE_MARGIN * RATE - per_read


@pytest.mark.parametrize('factor', [1.0, 0.1, 5.0])
def test_no_frame_is_thinned_at_a_rate_that_a_sensor_may_have(factor):
    clock, rng, got = FrameClock(FlexiTacDecoder(*SHAPE), RATE), np.random.default_rng(0), 0
    clock.receive(MARKER, NOON)
    late = 0.3 * PERIOD * rng.random(2000)
    for k in range(2000):
        got += len(clock.receive(
            encode_next(picture(k)), NOON + round((k + 1) * PERIOD / factor + late[k])))
    assert got == 2000 and clock.thinned == clock.stalled == 0


def test_times_rise_and_survive_a_clock_that_is_set_back(clock):
    times = [frame.stamp_ns for k in range(20) for frame in clock.receive(
        encode_next(picture(k)), NOON + PERIOD + (k // 5) * 100)]
    assert times == sorted(set(times))
    (stamped,) = clock.receive(encode_next(picture(1)), NOON - 10**12)
    assert stamped.stamp_ns == NOON - 10**12


def test_a_device_of_unknown_rate_that_sends_slowly_is_heard():
    clock, got = FrameClock(FlexiTacDecoder(*SHAPE)), 0
    clock.receive(MARKER, NOON)
    for k in range(100):
        data, at = encode_next(picture(k)), NOON + k * 100_000_000
        clock.receive(data[:10], at + 10_000_000)
        got += len(clock.receive(data[10:], at + 90_000_000))
    assert got >= 97


def test_a_new_start_forgets_half_a_frame(clock):
    clock.receive(encode_next(picture(1))[:7], NOON + PERIOD)
    clock.restart()
    assert clock.decoder.buffered == 0
    data = MARKER + b''.join(encode_next(picture(k)) for k in range(4))
    assert len(clock.receive(data, NOON + 10**10)) == 4
    assert clock.stalled == 0


@pytest.mark.parametrize('there', [
    range(16), range(84, 100), range(0, 100, 2), [*range(50), *range(53, 100)]],
    ids=['the oldest', 'the newest', 'every second', 'all but three'])
def test_frames_of_a_backlog_that_others_are_missing_from_are_not_given(clock, there):
    """A reader is .5 s late: nobody knows when the frames were sent that are there."""
    data = b''.join(encode_next(picture(k)) for k in there)
    assert clock.receive(data, NOON + 100 * PERIOD, NOON) == []
    assert clock.stalled == len(there)
    (stamped,) = clock.receive(encode_next(picture(50)), NOON + 101 * PERIOD, NOON + 100 * PERIOD)
    assert stamped.stamp_ns == NOON + 101 * PERIOD


@pytest.mark.parametrize('late', [4, 20, 100])
@pytest.mark.parametrize('slower', [1, 2, 4], ids='as said, half, a quarter'.split(', '))
def test_frames_that_waited_and_are_all_there_have_their_time(late, slower):
    """Also those of a sensor that is slower than its nominal rate."""
    clock, period = FrameClock(FlexiTacDecoder(*SHAPE), RATE), slower * PERIOD
    clock.receive(MARKER, NOON)
    for k in range(-200, 1):
        clock.receive(encode_next(picture(0)), NOON + k * period)
    data = b''.join(encode_next(picture(k)) for k in range(late))
    got = clock.receive(data, NOON + late * period, NOON)
    np.testing.assert_allclose([frame.stamp_ns - NOON for frame in got],
                               period * np.arange(1, late + 1), atol=50 * 1000)


def received(jitter, drift=50e-6, seconds=14.0, stamp='', step=0, lost=()):
    """Return the times of a sensor's frames, and their stamps by the clock [s]."""
    rng = np.random.default_rng(6)
    count = round(seconds * RATE)
    sent = (np.arange(count) / RATE * (1.0 + drift)
            + (0.001 * rng.random(count) if stamp else 0.0))  # a device with irregular frames
    sent[count // 2:] += step
    device, clock = CsvDevice(stamp), FrameClock(CsvDecoder(*SHAPE, stamp=stamp), RATE)
    clock.receive(b'\n', NOON)
    arrival, stamps = 0.0, np.full(count, np.nan)
    for k, at in enumerate(sent):
        arrival = max(at + jitter(rng), arrival)
        data = device.encode(picture(k), round(at / (1.0 + drift) * 1e9))
        if k in lost:
            data = b'x' + data
        for frame in clock.receive(data, NOON + round(arrival * 1e9)):
            stamps[k] = 1e-9 * (frame.stamp_ns - NOON)
    return sent, stamps


@pytest.mark.parametrize('stamp', ['', 'us'])
@pytest.mark.parametrize('jitter, counted', [
    (lambda rng: 0.002 * rng.random(), 0.3e-3), (lambda rng: abs(rng.normal(0.0, 0.002)), 0.3e-3),
    (lambda rng: rng.exponential(0.002), 1e-3)], ids=['uniform', 'normal', 'exponential'])
def test_stamps_are_without_the_jitter_of_the_reception(jitter, counted, stamp):
    """
    At 200 Hz, with 2 ms of jitter and a clock error of 50 ppm: .3 ms RMS after 5 s.

    Without stamps of the device, the time is corrected by a period at most.
    """
    sent, stamps = received(jitter, stamp=stamp)
    off = (stamps - sent)[round(5.0 * RATE):]
    assert np.sqrt(np.mean(off**2)) < (0.3e-3 if stamp else counted)
    assert np.all(np.diff(stamps) > 0.0)


@pytest.mark.parametrize('step', [-0.004, 0.1, 2.0])
def test_a_device_that_pauses_is_followed_within_half_a_second(step):
    sent, stamps = received(lambda rng: 0.002 * rng.random(), step=step)
    off = (stamps - sent)[len(sent) // 2:]
    assert np.all(off < 0.003 - min(step, 0.0)) and np.all(off > -0.0201)
    assert np.abs(off[round(0.55 * RATE):]).max() < 0.0021
    assert np.sqrt(np.mean(off[round(3.0 * RATE):]**2)) < 0.3e-3


def test_frames_that_a_device_leaves_out_without_a_word_move_no_stamp():
    rng, clock = np.random.default_rng(9), FrameClock(CsvDecoder(*SHAPE), RATE)
    clock.receive(b'\n', NOON)
    device, off, arrival = CsvDevice(), [], 0
    for k in range(3000):
        if k > 1000 and rng.random() < 0.1:  # neither sent nor counted
            continue
        sent = k * PERIOD
        stall = 0.012e9 * (k > 1000 and rng.random() < 0.02)  # of the reader
        arrival = max(arrival, sent + round(stall + 1.5e6 * rng.random()))
        for frame in clock.receive(device.encode(picture(k)), NOON + arrival):
            off.append((frame.stamp_ns - NOON - sent, arrival - sent))
    off, late = np.array(off[1000:]).T
    assert np.sqrt(np.mean(off[late < 2e6]**2)) < 0.3e6
    assert np.all(off <= late + 100) and off.min() > -0.3e6


@pytest.mark.parametrize('nominal', [RATE, RATE / 2, 0.0])
@pytest.mark.parametrize('stamp', ['', 'us'])
@pytest.mark.parametrize('omitted', [0.0, 0.2])
def test_an_adapter_that_passes_frames_on_every_16_ms(nominal, stamp, omitted):
    """This is the default of common adapters from serial to USB. Most reads give 3 frames."""
    rng, clock = np.random.default_rng(2), FrameClock(CsvDecoder(*SHAPE, stamp=stamp), nominal)
    device, off, every = CsvDevice(stamp), [], 16_000_000
    clock.receive(b'\n', NOON)
    sent = PERIOD * np.flatnonzero(rng.random(4000) >= omitted)
    for read, group in groupby(sent, key=lambda at: -(-at // every) * every):
        times = list(group)
        data = b''.join(device.encode(picture(at // PERIOD), at) for at in times)
        off += [frame.stamp_ns - NOON - at for frame, at in
                zip(clock.receive(data, NOON + read), times, strict=True)]
    off = np.array(off[1000:])
    assert np.sqrt(np.mean(off**2)) < (2e6 if stamp else PERIOD) and abs(off).max() <= every


@pytest.mark.parametrize('omitted', [0.1, 0.3, 0.5])
@pytest.mark.parametrize('jitter', [0.001e9, 0.004e9])
def test_many_omitted_frames_make_no_stamp_older_than_by_a_period(omitted, jitter):
    """In every second block of 2.5 s; now and then the reader, too, is late by some periods."""
    rng, clock = np.random.default_rng(9), FrameClock(CsvDecoder(*SHAPE), RATE)
    clock.receive(b'\n', NOON)
    device, early, arrival = CsvDevice(), [], 0
    for k in range(4000):
        if rng.random() < omitted * (k // 500 % 2):
            continue
        stall = 0.012e9 * (rng.random() < 0.02)
        arrival = max(arrival, k * PERIOD + round(stall + jitter * rng.random()))
        early += [k * PERIOD - (frame.stamp_ns - NOON)
                  for frame in clock.receive(device.encode(picture(k)), NOON + arrival)]
    assert max(early) < PERIOD


def test_a_frame_that_is_counted_as_lost_moves_no_stamp():
    sent, stamps = received(lambda rng: 0.002 * rng.random(), lost=range(1200, 2700, 300))
    off = (stamps - sent)[round(5.0 * RATE):]
    assert np.isnan(off).sum() == 5
    assert np.sqrt(np.nanmean(off**2)) < 0.3e-3


@pytest.mark.parametrize('tick', [
    lambda rng, k: 7, lambda rng, k: rng.integers(2**32), lambda rng, k: -k % 2**32,
    lambda rng, k: k * 2**31 % 2**32, lambda rng, k: k * 3],
    ids=['constant', 'random', 'backwards', 'two values', 'slow'])
@pytest.mark.parametrize('rate', [RATE, 0.0])
def test_a_device_whose_clock_is_nonsense_gets_times_of_arrival_or_shortly_before(tick, rate):
    rng, got = np.random.default_rng(7), []
    clock = FrameClock(CsvDecoder(1, 1, stamp='ms'), rate)
    clock.receive(b'\n', NOON)
    for k in range(5000):
        now = NOON + k * PERIOD
        got += [(it.stamp_ns, now) for it in clock.receive(b'%d,1\n' % tick(rng, k), now)]
    stamps, nows = np.array(got).T
    assert len(got) == 5000 and np.all(np.diff(stamps) > 0)
    assert np.all(stamps <= nows + 1) and np.all(nows - stamps <= 20_000_000)


def test_a_clock_of_the_machine_that_stands_still_costs_no_memory():
    """For example simulated time that is paused."""
    clock = FrameClock(CsvDecoder(1, 1, stamp='ms'))
    clock.receive(b'\n', NOON)
    for k in range(12_000):
        clock.receive(b'%d,1\n' % k, NOON)
    assert len(clock._send_time._block) <= 10_000
