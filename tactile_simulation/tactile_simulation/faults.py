"""Faults of a simulation: wrong sensor readings, late windows, a silent client."""
from collections.abc import Sequence
from dataclasses import dataclass
import math
import re

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_simulation.sensor import Sensor

# Description of each kind and the unit of its value, or None if it takes no value.
KINDS: dict[str, tuple[str, str | None]] = {
    'zero': ('reads its tare, as a skin that was unplugged after it', None),
    'half_dead': ('half of the columns read their tare', None),
    'middle_dead': ('the middle half of the columns reads its tare', None),
    'frozen': ('the same image again and again, with stamps that run on', None),
    'fade': ('the gain falls to nothing within SECONDS', None),
    'gain': ('the gain is multiplied by VALUE', '1'),
    'drift': ('all readings drift by VALUE', 'Pa/s'),
    'late': ('windows reach the robot later by VALUE', 's'),
    'stale_client': ('the client of the goal falls silent', None),
}
# Share of the columns at which a dead part begins and ends
DEAD = {'zero': (0.0, 1.0), 'half_dead': (0.0, 0.5), 'middle_dead': (0.25, 0.75)}
FORM = 'KIND@T[:SECONDS][=VALUE]'
_NUMBER = r'[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?'
_SYNTAX = re.compile(rf'(\w+)@({_NUMBER})(?::({_NUMBER}))?(?:=({_NUMBER}))?')


@dataclass(frozen=True)
class Fault:
    """A fault that begins `since` seconds after the start of the goal and lasts `lasting` s."""

    kind: str
    since: float
    lasting: float = math.inf
    value: float = math.nan

    @classmethod
    def of(cls, text: str) -> 'Fault':
        """Parse `KIND@T[:SECONDS][=VALUE]`; ConfigurationError if it is invalid."""
        match = _SYNTAX.fullmatch(text)
        kind = match[1] if match else text.partition('@')[0]
        if kind not in KINDS:
            raise ConfigurationError(
                f'fault {text!r}: {kind!r} is none of {", ".join(KINDS)}')
        if match is None or float(match[2]) < 0.0:
            raise ConfigurationError(f'fault {text!r}: must read {FORM}, T from 0 s on')
        unit = KINDS[kind][1]
        if (match[4] is None) != (unit is None):
            raise ConfigurationError(f'fault {text!r}: {kind} takes ' + (
                'no =VALUE' if unit is None else f'=VALUE [{unit}]'))
        lasting = float(match[3] or math.inf)
        if not lasting > 0.0 or (kind == 'fade' and lasting == math.inf):
            raise ConfigurationError(f'fault {text!r}: takes :SECONDS above 0')
        value = float(match[4] or 'nan')
        if math.isinf(value) or kind == 'late' and value < 0.0:
            raise ConfigurationError(
                f'fault {text!r}: VALUE must be finite' + ' and not negative' * (kind == 'late'))
        return cls(kind, float(match[2]), lasting, value)

    def acts(self, at: float) -> bool:
        """Return True if the fault is active `at` seconds after the start; `fade` stays."""
        return self.since <= at and (self.kind == 'fade' or at < self.since + self.lasting)


class Faults:
    """What the faults do to a simulation; `at` is the time since the start of the goal [s]."""

    def __init__(self, faults: Sequence[Fault], sensor: Sensor):
        self._faults, self._sensor = faults, sensor
        self._sent: np.ndarray | None = None

    def counts(self, counts: np.ndarray, at: float) -> np.ndarray:
        """Return the frame that is sent in place of a frame (rows, columns) of counts."""
        if not self._faults:
            return counts
        sensor, width = self._sensor, counts.shape[1]
        acting = [fault for fault in self._faults if fault.acts(at)]
        if self._sent is not None and any(fault.kind == 'frozen' for fault in acting):
            return self._sent
        read = counts.astype(float) - sensor.baseline
        for fault in acting:
            kind, passed = fault.kind, at - fault.since
            if kind in DEAD:
                first, end = (round(share * width) for share in DEAD[kind])
                read[:, first:end] = 0.0
            elif kind == 'fade':
                read *= max(1.0 - passed / fault.lasting, 0.0)
            elif kind == 'gain':
                read *= fault.value
            elif kind == 'drift':
                read += fault.value * passed / sensor.pa_per_count
        self._sent = np.clip(np.rint(read + sensor.baseline), 0, (1 << sensor.bits) - 1).astype(
            counts.dtype)
        return self._sent

    def delay(self, at: float) -> float:
        """Return the additional delay of a window that is sent now [s]."""
        return sum(fault.value for fault in self._faults
                   if fault.kind == 'late' and fault.acts(at))

    def client_lives(self, at: float) -> bool:
        """Return True if the goal's client sends heartbeats; without faults there is none."""
        return bool(self._faults) and not any(
            fault.kind == 'stale_client' and fault.acts(at) for fault in self._faults)


def describe_faults() -> str:
    """Return the kinds of faults, one per line."""
    return '\n'.join([f'faults, {FORM}; T in seconds after the goal, lasting SECONDS:',
                      *(f'  {kind:14}{text}' + (f' [{unit}]' if unit else '')
                        for kind, (text, unit) in KINDS.items())])
