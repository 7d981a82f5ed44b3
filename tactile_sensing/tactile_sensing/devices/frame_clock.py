"""Compute the stamps of a sensor's frames and reject bad frames; reads no clock itself."""
from collections import Counter, deque
import math
from typing import NamedTuple

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.protocol import Decoder, Frame

NS = 1_000_000_000
# A frame whose bytes take longer than both does not show one instant.
STALL_PERIODS, STALL_NS = 3, 10_000_000
RATE_MARGIN = 6.0  # largest rate relative to the nominal one: a sensor may be set faster
MAX_RATE = 10e3  # largest rate if no nominal rate is known [Hz]
# Periods that a backlog may lack: one for a frame that was left out, and one for the part of a
# period before its first frame and after its last one.
MOST_MISSING = 2
BURST = 0.1  # frames of this time may arrive at once after a pause [s]
BLOCK_NS = NS // 2  # the frame with the smallest delay of each such block is used
LEAST_BLOCKS, BLOCKS = 4, 20  # smallest and largest number of blocks that a line is fitted to
OFF_LINE_NS = 1e6  # a clock or a count has jumped if a block is farther from the line [ns]
# A late frame shows that others were omitted if the jitter is below this share of a period.
SURE = 0.6
EARLY = 0.25  # a frame may be early by this share of a period
MOST_JITTER = 3.0  # largest correction of a frame's arrival [times the usual jitter]
JUMP_NS = NS  # a stamp earlier than the last one by this shows that the clock was set back [ns]


class SensorImage(NamedTuple):
    """One image of a sensor with its stamp."""

    stamp_ns: int  # arrival of its last byte, corrected for jitter and unusual delays
    sequence: int  # number of images before this one, including an estimate of lost ones
    counts: np.ndarray  # shape (rows, columns)


class SendTime:
    """
    Estimate when frames were sent, without the jitter of their reception.

    A frame cannot arrive before it was sent. Of frames that are evenly spaced in device time,
    those with the smallest delay lie on a line of arrival over device time; its slope includes the
    drift of the device's clock. If the device time is only a count of frames, a frame that is late
    by a period shows that the device omitted a frame, provided that the jitter is well below a
    period. The result is never later than the arrival, and earlier by at most three times the
    usual jitter, with a count also by at most a period: omitted frames look like jitter.
    """

    def __init__(self) -> None:
        self._left_out_ns = 0  # device time of frames that the device did not count [ns]
        self._jitter_ns = 0.0
        self.restart()

    def restart(self) -> None:
        """Start again; until a line is fitted, the arrival is returned."""
        self._block: list[tuple[int, int]] = []  # device time and arrival
        self._blocks: deque[np.ndarray] = deque(maxlen=BLOCKS)
        # Slope and offset relative to the origin; slope 0: no line yet.
        self._line = 0.0, 0.0
        self._origin = (0, 0)

    def of(self, device_ns: int, arrival_ns: int, latest_ns: int, period_ns: float = 0.0) -> int:
        """
        Return when a frame was sent [ns], given its device time, assumed and latest arrival.

        If the device time is a count of frames times their period, give the period too.
        """
        device_ns += self._left_out_ns
        if self._jitter_ns < SURE * self._line[0] * period_ns:
            late_ns = arrival_ns - self._sent(device_ns)
            left_out_ns = round(period_ns * math.floor(
                late_ns / (self._line[0] * period_ns) + EARLY))
            self._left_out_ns += left_out_ns
            device_ns += left_out_ns
        self._block.append((device_ns, latest_ns))
        if (abs(latest_ns - self._block[0][1]) >= BLOCK_NS
                or len(self._block) >= MAX_RATE):  # in case the clock stands still
            self._blocks.append(np.array(self._block))
            self._block = []
            self._fit()
        if not self._line[0]:
            return arrival_ns
        most_ns = round(min(MOST_JITTER * self._jitter_ns, period_ns or math.inf))
        return min(max(self._sent(device_ns), arrival_ns - most_ns), latest_ns)

    def _sent(self, device_ns: int) -> int:
        slope, offset = self._line
        return self._origin[1] + round(slope * (device_ns - self._origin[0]) + offset)

    def _fit(self) -> None:
        if len(self._blocks) < LEAST_BLOCKS:
            return
        origin = self._blocks[0][0]
        blocks = [(block - origin).astype(float) for block in self._blocks]
        lowest = np.concatenate(blocks)
        for _ in range(3):
            (x, y), mean = lowest.T, lowest.mean(axis=0)
            slope = np.dot(x - mean[0], y - mean[1]) / max(np.dot(x - mean[0], x - mean[0]), 1.0)
            lowest = np.array([block[(block[:, 1] - slope * block[:, 0]).argmin()]
                               for block in blocks])
        offset = mean[1] - slope * mean[0]
        if np.abs(lowest[:, 1] - slope * lowest[:, 0] - offset).max() > OFF_LINE_NS:
            # Start again with the last block.
            last = self._blocks[-1]
            self.restart()
            self._blocks.append(last)
            return
        delays = np.concatenate([block[:, 1] - slope * block[:, 0] - offset for block in blocks])
        self._jitter_ns = float(np.percentile(delays, 95))
        self._line = float(slope), float(offset)
        self._origin = int(origin[0]), int(origin[1])


class FrameClock:
    """
    Feed a decoder with received bytes and return images with stamps.

    If the bytes of a frame took longer than usual, its stamp is earlier by the difference, because
    a frame is as old as its first byte. If they took `STALL_PERIODS` and `STALL_NS`, the frame is
    rejected. If several frames are read at once, they are assumed to have arrived one period
    apart. If the reader had not caught up with the port for as long as a stall, and frames of that
    time are missing, those that are there may be older or newer: they are rejected, unless they
    have times of the device. The rate of images is limited to `RATE_MARGIN` times the nominal rate
    [Hz], or to `MAX_RATE` if that is 0, averaged over `BURST`.
    """

    def __init__(self, decoder: Decoder, nominal_rate: float = 0.0):
        if not 0.0 <= nominal_rate <= MAX_RATE:  # NaN fails as well
            raise ConfigurationError(
                f'rate is {nominal_rate} Hz, must be from 0 to {MAX_RATE:g} Hz')
        self.decoder = decoder
        self._limit = RATE_MARGIN * nominal_rate or MAX_RATE  # Hz
        # Frames that were rejected: it is unknown when they were sent, or the rate was too high.
        self.stalled = self.thinned = 0
        self.jitter_ns = 0.0  # mean delay of frames between stamp and reading
        self._nominal_ns = NS / nominal_rate if nominal_rate else 0.0
        self._period_ns = self._nominal_ns
        self._usual_ns = 0.0  # usual time from the first to the last byte of a frame
        self._credit = BURST * self._limit
        self._received = self._backlog = 0  # bytes; frames since the reader caught up
        self._caught_up_ns: int | None = None
        self._send_time = SendTime()
        self._newest_ns = self._given_ns = 0  # arrival of the newest frame; last stamp
        # Reads that may contain bytes of a future frame: position after each read, and its time.
        self._arrivals: deque[tuple[int, int]] = deque()

    def restart(self) -> None:
        """Start again, after the port was opened."""
        self.decoder.reset()
        self._send_time.restart()
        self._arrivals.clear()

    def receive(self, data: bytes, now_ns: int,
                caught_up_ns: int | None = None) -> list[SensorImage]:
        """
        Return the images that are complete with bytes that were read at `now_ns` [ns].

        The bytes arrived after `caught_up_ns`; None: just before they were read.
        """
        if caught_up_ns is None or caught_up_ns != self._caught_up_ns:
            self._caught_up_ns, self._backlog = caught_up_ns, 0
        self._received += len(data)
        self._arrivals.append((self._received, now_ns))
        self.decoder.receive_data(data)
        frames = []
        for frame in iter(self.decoder.next_frame, None):
            # When its first and its last byte were read.
            self._forget(frame.first_byte)
            last_ns = next(at for end, at in self._arrivals if end >= frame.end)
            frames.append((frame, self._arrivals[0][1], last_ns))
        self._forget(self._received - self.decoder.buffered)
        given = []
        behind = Counter(last_ns for *_, last_ns in frames)  # remaining frames of each read
        self._backlog += len(frames)
        waited_ns = 0 if caught_up_ns is None else now_ns - caught_up_ns
        uncertain = (waited_ns >= self.stall_ns()
                     and waited_ns >= (self._backlog + MOST_MISSING) * self._period_ns)
        for frame, first_ns, last_ns in frames:
            behind[last_ns] -= 1
            if uncertain and frame.device_ns is None:
                self.stalled += 1
                continue
            arrival_ns = max(last_ns - round(behind[last_ns] * self._period_ns), caught_up_ns or 0)
            stamp_ns = self._judge(frame, first_ns, arrival_ns, last_ns)
            if stamp_ns is not None:
                self.jitter_ns += 0.02 * (now_ns - stamp_ns - self.jitter_ns)
                given.append(SensorImage(stamp_ns, frame.sequence, frame.counts))
        if frames:
            since_ns = now_ns - self._newest_ns
            if self._newest_ns and since_ns > 0:
                gain = 0.1 if self._period_ns else 1.0
                most_ns = 2.0 * self._period_ns or NS  # limits the effect of a pause
                self._period_ns += gain * (min(since_ns / len(frames), most_ns) - self._period_ns)
            self._newest_ns = now_ns
        return given

    def _forget(self, position: int) -> None:
        while self._arrivals and self._arrivals[0][0] <= position:
            self._arrivals.popleft()

    def stall_ns(self) -> float:
        """Return the time from which on the bytes of a frame take too long [ns]."""
        period_ns = self._nominal_ns or self._period_ns
        return max(STALL_PERIODS * period_ns, STALL_NS) if period_ns else NS

    def _judge(self, frame: Frame, first_ns: int, last_ns: int, read_ns: int) -> int | None:
        """Return the stamp of a frame [ns], None: rejected; `last_ns` is its assumed arrival."""
        took_ns = max(last_ns - first_ns, 0)
        if took_ns >= self.stall_ns():
            self.stalled += 1
            return None
        stamp_ns = last_ns - max(took_ns - round(self._usual_ns), 0)
        self._usual_ns += 0.1 * (took_ns - self._usual_ns)
        if frame.device_ns is not None:
            stamp_ns = self._send_time.of(frame.device_ns, stamp_ns, read_ns)
        elif self._nominal_ns:
            stamp_ns = self._send_time.of(round(frame.sequence * self._nominal_ns), stamp_ns,
                                          stamp_ns, self._nominal_ns)
        if 0 <= self._given_ns - stamp_ns < JUMP_NS:
            stamp_ns = self._given_ns + 1  # the period was overestimated
        elapsed = 1e-9 * max(stamp_ns - self._given_ns, 0)
        credit = min(self._credit + elapsed * self._limit, BURST * self._limit)
        if credit < 1.0:
            self.thinned += 1
            return None
        self._credit, self._given_ns = credit - 1.0, stamp_ns
        return stamp_ns
