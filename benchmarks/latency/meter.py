"""Wraps functions of a running node: processor time of each call, and instants along the way."""

from collections import defaultdict
from contextlib import contextmanager, ExitStack
from functools import wraps
from time import thread_time, time_ns
from unittest.mock import patch

import numpy as np


class Meter:
    """
    Processor times of calls [s] by name, while `running`.

    Clocks cost: the whole is timed by itself, and its parts while it is taken `apart`. A part
    whose name begins with - counts `inside` of the whole only.
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
        """Return a function that does the same and is timed, as a part or as the whole."""
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
    """Instants [ns] of the pictures on their way to a command, by their stamps."""

    def __init__(self):
        self.heard, self.begun, self.sent = {}, {}, {}
        self._cycle_begun, self._new = 0, None

    def hear(self, stamp_ns):
        """A picture has come."""
        self.heard[stamp_ns] = time_ns()

    def begin(self):
        """A cycle begins."""
        self._cycle_begun = time_ns()

    def use(self, stamp_ns):
        """The law has taken a picture."""
        self._new = stamp_ns

    def send(self):
        """A command has been sent."""
        if self._new is not None:
            self.begun[self._new], self.sent[self._new] = self._cycle_begun, time_ns()
            self._new = None

    def stages(self, published, delay_ns):
        """Durations [s] of every stage, for pictures that led to a command, name -> (N,)."""
        stamps = np.array([stamp for stamp in self.sent
                           if stamp in published and stamp in self.heard], np.int64)
        way = [stamps + delay_ns] + [
            np.array([at[stamp] for stamp in stamps.tolist()], np.int64)
            for at in (published, self.heard, self.begun, self.sent)]
        names = ('driver', 'transport', 'waiting', 'cycle')
        result = {name: 1e-9 * (after - before)
                  for name, before, after in zip(names, way[:-1], way[1:], strict=True)}
        return {**result, 'total': 1e-9 * (way[-1] - way[0])}
