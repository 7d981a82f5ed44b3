"""What the law 'trace' remembers: what images said, and what the pad is doing."""

from dataclasses import dataclass
import math

from tactile_servo.control.force_controller import Load
from tactile_servo.reasons import Reason, ReasonCode


@dataclass
class Seen:
    """
    What images said last.

    looked, shown: steady time of the last usable image, and of the last that shows the edge
    [s]; age: mean [s]; problem: why the last one does not show it; load, height, station: as
    it was taken; slope: of the edge along itself.
    """

    looked: float = -math.inf
    shown: float = -math.inf
    age: float = 0.0
    problem: Reason | None = Reason(ReasonCode.NO_IMAGE)
    load: Load = Load()
    height: float = 0.0
    station: float = 0.0
    slope: float = 0.0


@dataclass
class Going:
    """
    Where the pad is, and what it is doing there.

    mode : ReasonCode
        TRACKING, COASTING, SEARCHING or REACHING_DOWN.
    here, ahead : float
        Stations of the measured and the commanded pad [m].
    depth, probed_from : float
        Commanded height along the plane's normal, and where a probe began [m].
    coasted, searched : float
        Ways so far [m].
    reached, reached_at : float
        Way at which there was progress last [m], and when [s].
    begun, pressed : bool
        The pad moves along the edge, and has pressed enough to see all of it.
    """

    here: float = 0.0
    ahead: float = 0.0
    begun: bool = False
    coasted: float = 0.0
    mode: ReasonCode = ReasonCode.TRACKING
    searched: float = 0.0
    depth: float = 0.0
    probed_from: float | None = None
    pressed: bool = False
    reached: float = 0.0
    reached_at: float | None = None

    def anew(self) -> 'Going':
        """After a standstill: at the same place."""
        return Going(self.here, self.ahead, self.begun, self.coasted)
