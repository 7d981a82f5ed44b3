"""Wraps functions of a running node to measure processor times of calls and instants."""

from collections import defaultdict
from contextlib import contextmanager, ExitStack
from functools import wraps
from time import thread_time, time_ns
from unittest.mock import patch

import numpy as np


class Meter:
    """
    Processor times of calls [s] by name, while `running`.

    Clocks take time. So the whole is timed alone, and its parts only while `apart` is True. A part
    whose name begins with - counts only `inside` the whole.
    """

    def __init__(self):
        self.running = self.apart = self.inside = False
        self.times = defaultdict(list)

    @contextmanager
    def timing(self, parts):
        """Time functions, given as name -> (owner, attribute), in a `with` statement."""
        with ExitStack() as stack:
            for name, (owner, attribute) in parts.items():
                stack.enter_context(patch.object(
                    owner, attribute, self.timed(name, getattr(owner, attribute))))
            yield

    def timed(self, name, function, whole=False):
        """Return the same function with timing, as a part or as the whole."""
        times, inner = self.times[name], name.startswith('-')

        @wraps(function)
        def call(*arguments):
            if not self.running or self.apart == whole or (inner and not self.inside):
                return function(*arguments)
            begin = thread_time()
            try:
                return function(*arguments)
            finally:
                times.append(thread_time() - begin)
        return call


class Journey:
    """Instants [ns] of the images on their way to a command, by their stamps."""

    def __init__(self):
        self.heard, self.begun, self.sent = {}, {}, {}
        self._cycle_begun, self._new = 0, None

    def hear(self, stamp_ns):
        """Record the arrival of an image."""
        self.heard[stamp_ns] = time_ns()

    def begin(self):
        """Record the begin of a cycle."""
        self._cycle_begun = time_ns()

    def use(self, stamp_ns):
        """Record that the law took an image."""
        self._new = stamp_ns

    def send(self):
        """Record that a command was sent."""
        if self._new is not None:
            self.begun[self._new], self.sent[self._new] = self._cycle_begun, time_ns()
            self._new = None

    def stages(self, published, delay_ns):
        """Return durations [s] of every stage, for images that led to a command, name -> (N,)."""
        stamps = np.array([stamp for stamp in self.sent
                           if stamp in published and stamp in self.heard], np.int64)
        way = [stamps + delay_ns] + [
            np.array([at[stamp] for stamp in stamps.tolist()], np.int64)
            for at in (published, self.heard, self.begun, self.sent)]
        names = ('driver', 'transport', 'waiting', 'cycle')
        result = {name: 1e-9 * (after - before)
                  for name, before, after in zip(names, way[:-1], way[1:], strict=True)}
        return {**result, 'total': 1e-9 * (way[-1] - way[0])}
