"""What the law 'trace' remembers: what images said, and what the pad is doing."""

from dataclasses import dataclass
import math

from tactile_servo.control.force_controller import Load
from tactile_servo.reasons import Reason, ReasonCode


@dataclass
class Seen:
    """What images said last."""

    looked: float = -math.inf  # steady time of the last usable image [s],
    shown: float = -math.inf  # and of the last that shows the edge
    age: float = 0.0  # mean [s]
    problem: Reason | None = Reason(ReasonCode.NO_IMAGE)  # why the last does not show it
    load: Load = Load()
    height: float = 0.0  # of the pad as it was taken [m],
    station: float = 0.0  # and where on the path
    slope: float = 0.0  # of the edge along itself


@dataclass
class Going:
    """Where the pad is, and what it is doing there."""

    here: float = 0.0  # station of the measured pad [m],
    ahead: float = 0.0  # and of the commanded one
    progress: float = 0.0  # way of the pad [m]
    begun: bool = False  # the pad moves along the edge
    coasted: float = 0.0  # way so far [m]
    mode: ReasonCode = ReasonCode.TRACKING  # or COASTING, SEARCHING, REACHING_DOWN
    searched: float = 0.0  # way so far [m]
    depth: float = 0.0  # commanded height along the plane's normal [m],
    probed_from: float | None = None  # and where a probe began
    pressed: bool = False  # it has pressed enough to see all of the edge
    reached: float = 0.0  # way at which there was progress last [m],
    reached_at: float | None = None  # and when [s]

    def anew(self) -> 'Going':
        """After a standstill: at the same place."""
        return Going(self.here, self.ahead, self.progress, self.begun, self.coasted,
                     probed_from=self.probed_from)
