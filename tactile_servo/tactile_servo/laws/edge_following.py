"""Law 'trace': maps the edge with the robot's pose at each image's stamp, and follows the map."""

import math
from typing import ClassVar

import numpy as np

from tactile_sensing.types.image import SensorInfo
from tactile_servo.config import image_patience, PRESS_DEPTH, ServoConfig, STALE_AFTER
from tactile_servo.control.press_test import PRESSED
from tactile_servo.control.progress import LapGuard, Stall
from tactile_servo.edge_map.path_queries import PathPosition
from tactile_servo.edge_map.traced_path import PathEnd
from tactile_servo.law import Assessment, done, LawResult, Observation, Reference, UNPLACED
from tactile_servo.laws.edge_law import EdgeLaw, SKIN_STIFFNESS, skin_stiffness_of, total_stiffness
from tactile_servo.laws.edge_motion import EdgeFollowingConfig, EdgeMotion
from tactile_servo.laws.edge_sight import EdgeSight
from tactile_servo.motion.motion import Motion
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import depth_of, EdgeGoal, State

LARGE_YAW = 2.0  # degrees beyond which a turn of the mounting is named
ADVANCE = 0.5  # grains, advance that counts as progress
KEPT = 0.25  # share of the goal's force that a skin that creeps may keep without contact
# Times `image_patience`, time without a usable image; longer than the supervisor's own timeout,
# which handles missing images
STALE = 1.5
SEARCH = 0.02  # m/s, largest speed in the search for a lost edge
END_MARGIN = 1.5  # grains before the end of a ridge at which coasting begins
# Half sizes of the pad: a half diagonal, after which an edge has left the pad in any direction
PAD_LEFT = 1.42
SEARCH_REACH = 1.18  # half sizes of the pad, longest way of a search towards the load
# Share of PRESS_DEPTH; the rest is passed in the longest pause of the cycles, and in the stop.
PROBED_DEPTH = 0.8
STILL = np.zeros(3)
FORK = 'where another one begins: a fork, or a corner that is too sharp to follow'

Move = tuple[tuple[float, float], float, np.ndarray]


class Travel:
    """Way of the commanded pad in a mode of the law, which ends the mode."""

    def __init__(self) -> None:
        self.way = self.depth = 0.0  # length, and depth along the pad's normal at its begin [m]
        self._begin: np.ndarray | None = None
        self._last = np.zeros(3)

    def count(self, there: np.ndarray) -> np.ndarray:
        """Process the commanded pose (4, 4) in the plane; return the normal at the begin (3,)."""
        place = there[:3, 3]
        if self._begin is None:
            self._begin, self._last = there, place
        self.way += float(np.linalg.norm(place - self._last))
        self._last, normal = place, self._begin[:3, 2]
        self.depth = float((place - self._begin[:3, 3]) @ normal)
        return normal


class EdgeFollowing(EdgeLaw):
    """
    Follow the edge mapped from images, using the robot's own pose.

    The points of every image are transformed into a plane fixed in the base, with the pose at the
    image's stamp. Latency therefore delays only the view ahead; it is not part of the loop.

    Its mode is the reason for its motion: tracking; coasting straight on from the end of a ridge,
    across a possible gap; searching, towards the pressure; or reaching down, along the normal.
    """

    name: ClassVar[str] = 'trace'
    config_type: ClassVar[type] = EdgeFollowingConfig

    def __init__(self, servo: ServoConfig, config: EdgeFollowingConfig | None = None):
        self.servo, self.config = servo, config or EdgeFollowingConfig()
        self._stale = STALE_AFTER
        self._forget(EdgeGoal(0.0, 0.0), SKIN_STIFFNESS, math.nan)

    def _forget(self, goal: EdgeGoal, skin_stiffness: float, stiffness: float) -> None:
        self.goal, self.stiffness = goal, stiffness
        self._contact_force = max(self.servo.contact_force, KEPT * goal.force)
        self.sight = EdgeSight(goal, skin_stiffness, self._contact_force)
        self.press, self.error = self.sight.press, None
        self._motion = EdgeMotion(self.config, goal, self.sight, stiffness)
        self._laps, self._stall = LapGuard(), Stall()
        self._here = self._ahead = 0.0  # stations of the measured and the commanded pose [m]
        self._progress = 0.0  # distance travelled [m]
        self._unplaced = False  # True if the pose of the newest image is unknown
        self._begun = False  # True once the pad moves along the edge
        self._pressed = False  # True once the force was large enough to show the whole edge
        self._coasting = Travel()
        self._find()

    def _find(self) -> None:
        """Return to tracking, with the edge visible."""
        self._mode = ReasonCode.TRACKING
        self._searching, self._reaching = Travel(), Travel()

    def retune(self, config: EdgeFollowingConfig) -> None:
        self.config = config
        self._motion.retune(config)

    def depth(self, force: float) -> float:
        """Return the indentation [m] for a force [N], with the edge length under the pad."""
        return self._motion.depth(force)

    def validate(self, goal: EdgeGoal) -> Reason | None:
        if goal.closed and goal.length > 0.0:
            return Reason(ReasonCode.INVALID_GOAL, 'a closed contour has no length; let it be 0')
        return super().validate(goal)

    def begin(self, goal: EdgeGoal, sensor: SensorInfo) -> None:
        depth_of(sensor.layers)  # images without it are not read
        self._stale = image_patience(sensor.nominal_rate)
        self._forget(goal, skin_stiffness_of(sensor), total_stiffness(sensor))

    def halt(self) -> None:
        self._motion.halted = True

    def resume(self) -> None:
        self._motion.reset()
        self.press.forget()
        self._stall.seen = None
        # A pad that was lifted off touches lightly at first.
        self._pressed &= self.sight.load.force >= self._contact_force
        self._mode, self._searching = ReasonCode.TRACKING, Travel()

    def observe(self, observation: Observation) -> None:
        """Process an image, or a contact: its fitted force is more accurate than the image's."""
        if observation.image is None:
            if observation.contact is not None:
                self.sight.refine(observation, observation.contact)
            return
        pose = observation.pose
        self._unplaced = pose is None
        # Until the pad moves along the edge, every image begins a new path.
        if pose is not None and self.sight.see(observation, pose, self._ahead, not self._begun):
            self._ahead = self._here = self.sight.edge.station
        self.error = self.sight.error

    def lacks(self, now: float) -> Reason | None:
        if now - self.sight.shown < self._stale:
            return None
        return UNPLACED if self._unplaced else self.sight.problem or Reason(ReasonCode.EDGE_LOST)

    def assess(self, now: float, progress: float, load: float) -> Assessment:
        found, yaw = super().assess(now, progress, load), math.degrees(self.sight.edge.yaw_error)
        if not found.success or abs(yaw) < LARGE_YAW:
            return found
        return done(found.reason.code, 'the sensor seems to be mounted with a turn of '
                    f'{yaw:.1f} degrees about its z', success=True)

    def _assess(self, now: float, progress: float, load: float) -> Assessment:
        edge = self.sight.edge
        path, scale = edge.path, edge.scale
        if order := self.sight.order.problem():
            return done(*order, lift=True)
        if self._mode is not ReasonCode.TRACKING:  # the other modes have their own limits
            self._stall = Stall()
        if self._stall.see(now, progress, ADVANCE * scale.grain, self.goal.speed):
            return done(ReasonCode.NO_PROGRESS, lift=True)
        if now - self.sight.looked > STALE * self._stale:
            return Assessment(State.HOLD, Reason(ReasonCode.STALE_IMAGE))
        if edge.closed and path.closing is not None and self._here >= path.closing:
            return done(ReasonCode.CONTOUR_CLOSED, success=True)
        lacking, touching = self.lacks(now), load >= self._contact_force
        # A lightly pressed pad touches only the highest part, so the edge seems to end early.
        self._pressed = self._pressed or self.sight.load.force >= PRESSED * self.goal.force
        tilted = self.sight.lifted and self._mode is ReasonCode.TRACKING and lacking is None
        if path.end is PathEnd.RIDGE and self._ahead >= path.tip - END_MARGIN * scale.grain and (
                self._pressed or lacking is not None) and not tilted:
            return self._at_end(load)
        self._coasting = Travel()
        if lacking is None:
            self._find()
            corner = edge.corner_at(self._ahead)
            return Assessment(State.TRACK, Reason(self._mode)) if corner is None else Assessment(
                State.CORNER, Reason(
                    ReasonCode.CORNER, f'{math.degrees(abs(corner.shape.turn)):.0f} degrees'))
        if not touching:
            return Assessment(State.HOLD, Reason(ReasonCode.CONTACT_LOST))
        if edge.picture.pull is None or self._searching.way > SEARCH_REACH * scale.half:
            return Assessment(State.HOLD, lacking)
        return self._search(ReasonCode.SEARCHING)

    def _at_end(self, load: float) -> Assessment:
        """Decide at the end of the ridge: coast over a gap, go down a step, or end."""
        touching = load >= self.servo.contact_force
        scale, way = self.sight.edge.scale, self._coasting.way
        margin, unseen = END_MARGIN * scale.grain, self._motion.speed * self.sight.age
        # Coasting began one margin before the end, and the end is uncertain by one margin. After
        # another half diagonal the edge has left the pad.
        if way - unseen < PAD_LEFT * scale.half + 2.0 * margin and (touching or way <= margin):
            return self._search(ReasonCode.COASTING)
        if load >= self._contact_force:
            return done(ReasonCode.EDGE_LOST, 'the ridge ends, but the pad is pressed')
        if self._reaching.depth <= PROBED_DEPTH * PRESS_DEPTH:
            return self._search(ReasonCode.REACHING_DOWN)
        if self.sight.edge.forks:
            return done(ReasonCode.EDGE_ENDED, FORK)
        return self._end_of_edge()

    def _search(self, mode: ReasonCode) -> Assessment:
        self._mode = mode
        self.press.forget()  # the edge found next may lie deeper
        return Assessment(State.SEARCH, Reason(mode))

    def reference(self, pose: np.ndarray, commanded: np.ndarray, robot: Motion,
                  dt: float) -> Reference:
        edge, motion = self.sight.edge, self._motion
        place = edge.locate(pose, commanded, self._here, self._ahead, motion.soon())
        self._begun = True
        move = {ReasonCode.TRACKING: self._follow, ReasonCode.COASTING: self._coast,
                ReasonCode.SEARCHING: self._seek, ReasonCode.REACHING_DOWN: self._reach_down}
        along, normal, turn = move[self._mode](place, robot, dt)
        if self._mode in (ReasonCode.TRACKING, ReasonCode.COASTING):
            self._here, self._ahead = place.here, place.ahead
        to_own = place.there[:3, :3].T
        heading = edge.way_in_base(*place.along)
        self._laps.see(pose[:3, 3].tolist(), pose[:3, 2].tolist(), heading, self._progress)
        return Reference(np.concatenate([to_own @ (*along, normal), to_own @ turn]),
                         motion.speed, heading)

    # Moves: each returns the motion of a cycle in the frame of the plane: velocity x, y in the
    # plane and along its normal [m/s], angular velocity (3,) [rad/s].

    def _follow(self, place: PathPosition, robot: Motion, dt: float) -> Move:
        motion = self._motion
        return (motion.along(place, robot, dt), motion.press(place, robot, dt),
                motion.turn(place, robot, dt))

    def _coast(self, place: PathPosition, robot: Motion, dt: float) -> Move:
        self._coasting.count(place.there)
        velocity = self._motion.along(place, robot, dt, may_lift=True)
        return velocity, self._motion.press(place, robot, dt, may_press=False), STILL

    def _seek(self, place: PathPosition, _: Motion, dt: float) -> Move:
        motion, pull = self._motion, self.sight.edge.picture.pull
        speed = 0.0 if motion.halted else min(SEARCH, self.goal.speed)
        assert pull is not None  # without a pull the law does not search
        self._searching.count(place.there)
        x, y = pull.tolist()
        return motion.aside(speed * x, speed * y, dt), 0.0, STILL

    def _reach_down(self, place: PathPosition, _: Motion, dt: float) -> Move:
        nx, ny, nz = self._reaching.count(place.there).tolist()
        x, y = self._motion.aside(0.0, 0.0, dt)
        down = self._motion.touch_speed(max(PRESS_DEPTH - self._reaching.depth, 0.0))
        # While the pad still moves in the plane, this changes the depth of an inclined pad too.
        return (x, y), (down - x * nx - y * ny) / nz, STILL

    def result(self) -> LawResult:
        return LawResult(self.sight.edge.closed, self.sight.edge.contour())
