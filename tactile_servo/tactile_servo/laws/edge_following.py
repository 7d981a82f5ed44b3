"""Law 'trace': maps the edge with the robot's pose at each image's stamp, and follows the map."""

from dataclasses import dataclass, field
import math
from typing import ClassVar

import numpy as np

from tactile_sensing.types.image import SensorInfo
from tactile_servo.config import image_patience, PRESS_DEPTH, ServoConfig, STALE_AFTER
from tactile_servo.control.lap_guard import LapGuard
from tactile_servo.control.press_test import PRESSED
from tactile_servo.edge_map.path_queries import to_sensor
from tactile_servo.edge_map.traced_path import PathEnd
from tactile_servo.law import Assessment, LawResult, Observation, Reference, Refusal, Touch
from tactile_servo.laws.edge_config import EdgeFollowingConfig
from tactile_servo.laws.edge_goal import ended, refuse_edge_goal, within_goal
from tactile_servo.laws.edge_modes import (
    Coasting,
    END_MARGIN,
    Following,
    Mode,
    ReachingDown,
    Searching,
)
from tactile_servo.laws.edge_motion import EdgeMotion
from tactile_servo.laws.edge_sight import EdgeSight
from tactile_servo.laws.stall import Stall
from tactile_servo.motion.agility import Agility
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import EdgeGoal, State, TaskError

ADVANCE = 0.5  # grains, advance that counts as progress
# Times `image_patience`, time without a usable image; longer than the supervisor's own timeout,
# which handles missing images
STALE = 1.5


@dataclass
class Going:
    """Progress of the pad along the edge."""

    here: float = 0.0  # station of the measured pose [m]
    ahead: float = 0.0  # station of the commanded pose [m]
    progress: float = 0.0  # distance travelled [m]
    stall: Stall = field(default_factory=Stall)
    begun: bool = False  # True once the pad moves along the edge
    pressed: bool = False  # True once the force was large enough to show the whole edge


class EdgeFollowing:
    """
    Follow the edge mapped from images, using the robot's own pose.

    The points of every image are transformed into a plane fixed in the base, with the pose at the
    image's stamp. Latency therefore delays only the view ahead; it is not part of the loop.
    """

    name: ClassVar[str] = 'trace'
    goal_type: ClassVar[type] = EdgeGoal
    config_type: ClassVar[type] = EdgeFollowingConfig
    sees_images: ClassVar[bool] = True
    near: ClassVar[float] = 1.0
    touch: Touch | None = None
    touch_speed = math.inf

    def __init__(self, servo: ServoConfig, config: EdgeFollowingConfig | None = None):
        self.servo, self.config = servo, config or EdgeFollowingConfig()
        self._stale = STALE_AFTER
        self._forget(EdgeGoal(0.0, 0.0))

    def _forget(self, goal: EdgeGoal) -> None:
        self.goal = goal
        self.sight = EdgeSight(goal, self.config.force.skin_stiffness)
        self._motion = EdgeMotion(self.config, goal, self.sight)
        self._going, self._laps = Going(), LapGuard()
        self._coasting = Coasting()
        self._find()

    def _find(self) -> None:
        """Return to following, with the edge visible."""
        self._mode: Mode = Following()
        self._searching = Searching()
        self._reaching = ReachingDown(PRESS_DEPTH)

    def retune(self, config: EdgeFollowingConfig) -> None:
        """Use new gains from now on."""
        self.config = config
        self._motion.retune(config)

    @property
    def error(self) -> TaskError | None:
        """Newest observed error of the pad at the edge; None before the first."""
        return self.sight.error

    @property
    def stiffness(self) -> float:
        """Total stiffness of skin, finger and robot along the normal [N/m]."""
        return self.config.force.stiffness

    def depth(self, force: float) -> float:
        """Return the indentation [m] for a force [N], with the edge length under the pad."""
        return self._motion.depth(force)

    @property
    def unfelt(self) -> float:
        """Force expected from the pad's depth, minus the force seen in images [N]."""
        return self.stiffness * self.sight.press.unexplained

    def validate(self, goal: EdgeGoal) -> Refusal | None:
        """Return why this law cannot execute a goal, or None."""
        if goal.closed and goal.length > 0.0:
            return Refusal(ReasonCode.INVALID_GOAL, 'a closed contour has no length; let it be 0')
        return refuse_edge_goal(goal)

    def begin(self, goal: EdgeGoal, sensor: SensorInfo) -> None:
        """Forget the last goal and start a new one."""
        self._stale = image_patience(sensor.nominal_rate)
        self._forget(goal)

    def resume(self) -> None:
        """Continue from a standstill, with the edge known so far."""
        self._motion.reset()
        self.sight.press.forget()
        self._going.stall.seen, self._going.pressed = None, False
        self._mode, self._searching = Following(), Searching()

    def observe(self, observation: Observation) -> None:
        """Process an image, or a contact: its fitted force is more accurate than the image's."""
        if observation.image is None:
            if observation.contact is not None:
                self.sight.refine(observation, observation.contact)
            return
        pose, going = observation.pose(), self._going
        # Until the pad moves along the edge, every image begins a new path.
        if pose is not None and self.sight.see(observation, pose, going.ahead, not going.begun):
            going.ahead = going.here = self.sight.edge.station

    def lacks(self, now: float) -> Reason | None:
        """Return what prevents the law from tracking, or None."""
        if now - self.sight.shown < self._stale:
            return None
        return self.sight.problem or Reason(ReasonCode.EDGE_LOST)

    def assess(self, now: float, progress: float, load: float) -> Assessment:
        """Decide whether to continue."""
        self._going.progress = progress
        return within_goal(self.goal, self._laps, progress, self._assess(now, progress, load))

    def _assess(self, now: float, progress: float, load: float) -> Assessment:
        going, edge = self._going, self.sight.edge
        path, scale = edge.path, edge.scale
        if self._stalled(now, progress):
            return Assessment(State.DONE, Reason(ReasonCode.NO_PROGRESS), lift=True)
        if now - self.sight.looked > STALE * self._stale:
            return Assessment(State.HOLD, Reason(ReasonCode.STALE_IMAGE))
        if edge.closed and path.closing is not None and going.here >= path.closing:
            return Assessment(State.DONE, Reason(ReasonCode.CONTOUR_CLOSED), True)
        lacking, touching = self.lacks(now), load >= self.servo.approach.contact_force
        # A lightly pressed pad touches only the highest part, so the edge seems to end early.
        going.pressed = going.pressed or self.sight.load.force >= PRESSED * self.goal.force
        if path.end is PathEnd.RIDGE and going.ahead >= path.tip - END_MARGIN * scale.grain and (
                going.pressed or lacking is not None):
            return self._at_end(progress, touching)
        self._coasting = Coasting()
        if lacking is None:
            self._find()
            corner = edge.corner_at(going.ahead)
            return Assessment(State.TRACK, self._mode.reason) if corner is None else Assessment(
                State.CORNER, Reason(
                    ReasonCode.CORNER, f'{math.degrees(abs(corner.turn)):.0f} degrees'))
        if not touching:
            return Assessment(State.HOLD, Reason(ReasonCode.CONTACT_LOST))
        if edge.picture.pull is None or self._searching.over(scale):
            return Assessment(State.HOLD, lacking)
        return self._search(self._searching)

    def _stalled(self, now: float, progress: float) -> bool:
        if not isinstance(self._mode, Following):  # the other modes have their own limits
            self._going.stall = Stall()
        return self._going.stall.see(
            now, progress, ADVANCE * self.sight.edge.scale.grain, self.goal.speed)

    def _at_end(self, progress: float, touching: bool) -> Assessment:
        """Decide at the end of the ridge: coast over a gap, go down a step, or end."""
        scale, coasting = self.sight.edge.scale, self._coasting
        unseen = self._motion.speed * self.sight.age
        if not coasting.over(scale, unseen) and (touching or coasting.begun(scale)):
            return self._search(coasting)
        if touching:
            return Assessment(State.DONE, Reason(
                ReasonCode.EDGE_LOST, 'the ridge ends, but the pad is pressed'))
        return self._reach_down() or ended(self.goal, progress, 2.0 * scale.half)

    def _reach_down(self) -> Assessment | None:
        """Move down to find contact; return None if the allowed depth is reached."""
        return None if self._reaching.over else self._search(self._reaching)

    def _search(self, mode: Mode) -> Assessment:
        self._mode = mode
        self.sight.press.forget()  # the edge found next may lie deeper
        return Assessment(State.SEARCH, mode.reason)

    def reference(self, pose: np.ndarray, commanded: np.ndarray, agility: Agility,
                  dt: float) -> Reference:
        """Return the reference for the measured and the commanded pose (4, 4) of the sensor."""
        edge, going, motion = self.sight.edge, self._going, self._motion
        stand = edge.stand(pose, commanded, going.here, going.ahead, motion.soon())
        going.begun = True
        wanted = self._mode.move(motion, stand, agility, dt)
        if isinstance(self._mode, (Following, Coasting)):
            going.here, going.ahead = stand.here, stand.ahead
        twist = np.empty(6)
        to_sensor(twist, stand.there, *wanted.velocity, wanted.normal, *wanted.turn)
        heading = edge.way_in_base(*stand.along)
        self._laps.see(pose[:3, 3].tolist(), pose[:3, 2].tolist(), heading, going.progress)
        return Reference(twist, motion.speed, heading)

    def result(self) -> LawResult:
        """Return whether the contour closed, and the edge in the base frame."""
        return LawResult(self.sight.edge.closed, self.sight.edge.contour())
