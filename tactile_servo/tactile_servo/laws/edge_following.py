"""Law 'trace': the edge is mapped where the robot was when each image was taken, and followed."""

import math
from typing import ClassVar

import numpy as np

from tactile_sensing.types.contact import Contact, ContactType
from tactile_sensing.types.image import SensorInfo, TactileImage
from tactile_servo.config import ServoConfig
from tactile_servo.control.attitude_controller import AttitudeController
from tactile_servo.control.force_controller import ForceController, Load
from tactile_servo.control.lap_guard import LapGuard
from tactile_servo.control.path_controller import PathController
from tactile_servo.control.speed_planner import SpeedPlanner
from tactile_servo.control.stability import AGE_SHARE
from tactile_servo.edge_map.edge_map import EdgeMap, Stand
from tactile_servo.edge_map.path_queries import to_sensor
from tactile_servo.edge_map.picture import Problem
from tactile_servo.edge_map.traced_path import PathEnd
from tactile_servo.law import Assessment, LawResult, Observation, Reference, Refusal, Touch
from tactile_servo.laws.edge_following_config import EdgeFollowingConfig
from tactile_servo.laws.edge_following_state import Going, Seen
from tactile_servo.laws.edge_goal import ended, refuse_edge_goal, within_goal
from tactile_servo.motion.agility import Agility
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import EdgeGoal, State, TaskError

# Of the force
PRESSED = 0.6  # from which what is seen of the edge is all of it
FITTED = 0.1  # within which the force of a fitted line is believed beside the sum's
# Grains, lengths that an image resolves
END_MARGIN = 2.0  # before the end of a ridge from which the pad coasts
LOOK_AHEAD = 0.2  # along the path over which its direction is taken
ADVANCE = 0.5  # that is progress
# Others
STALE = 1.5  # times the age at which the supervisor holds: for images that stop alone
PROBE = 0.9  # of the depth to which the pad may press
AGILE = 0.8  # of the acceleration in the plane, for which turns are planned
PROBE_SPEED = 0.5  # of the speed of the approach
ON_EDGE = Assessment(State.TRACK, Reason(ReasonCode.TRACKING))
UNFIT = {Problem.NO_RIDGE: ReasonCode.EDGE_LOST, Problem.ELSEWHERE: ReasonCode.EDGE_LOST}


class EdgeFollowing:
    """
    Follow the edge that the images drew, with the robot's own pose.

    The points of every image are put into a plane fixed in the base by the pose at the image's
    stamp, so that latency only ages what is seen ahead and is no part of the loop.
    """

    name: ClassVar[str] = 'trace'
    goal_type: ClassVar[type] = EdgeGoal
    config_type: ClassVar[type] = EdgeFollowingConfig
    sees_images: ClassVar[bool] = True
    goal: EdgeGoal  # since `begin`
    touch: Touch | None = None
    touch_speed = math.inf

    def __init__(self, servo: ServoConfig, config: EdgeFollowingConfig | None = None):
        self.servo, self.config = servo, config or EdgeFollowingConfig()
        c = self.config
        self._planner = SpeedPlanner(c.speed, c.path)
        self._path = PathController(c.path, c.speed.acceleration)
        self._force, self._attitude = ForceController(c.force), AttitudeController(c.attitude)
        self._forget()

    def _forget(self):
        self.edge = EdgeMap(self.config.force.skin_stiffness)
        self.error: TaskError | None = None
        self._seen, self._going, self._laps = Seen(), Going(), LapGuard()

    def retune(self, config: EdgeFollowingConfig) -> None:
        """Take other gains and speeds from now on."""
        self.config = c = config
        self._planner.config, self._path.config = c.speed, c.path
        self._force.config, self._attitude.config = c.force, c.attitude

    @property
    def stiffness(self) -> float:
        """Of skin, finger and robot along the normal [N/m]."""
        return self.config.force.stiffness

    def validate(self, goal: EdgeGoal) -> Refusal | None:
        """Why a goal is beyond this law, or None."""
        if goal.closed and goal.length > 0.0:
            return Refusal(ReasonCode.INVALID_GOAL, 'a closed contour has no length; let it be 0')
        return refuse_edge_goal(goal)

    def begin(self, goal: EdgeGoal, sensor: SensorInfo) -> None:
        """Forget the last goal and take a new one."""
        self.goal = goal
        self._forget()
        self.resume()

    def resume(self) -> None:
        """Go on from a standstill, with the edge known so far."""
        self._going = self._going.anew()
        for controller in (self._planner, self._path, self._force, self._attitude):
            controller.reset()

    def observe(self, observation: Observation) -> None:
        """Take an image; or a contact, whose fitted line tells the force better than a sum."""
        if observation.image is not None:
            pose = observation.pose()
            if pose is not None:
                self._see_image(observation.image, pose, observation)
        elif observation.contact is not None and self.edge.picture is not None and (
                observation.stamp_ns == self.edge.picture.stamp_ns):
            self._refine_force(observation.contact)

    def _refine_force(self, contact: Contact):
        load = self._seen.load
        if (contact.force_valid and contact.type == ContactType.LINE
                and abs(contact.normal_force - load.force) < FITTED * load.force):
            self._seen.load = load._replace(force=contact.normal_force)

    def _see_image(self, image: TactileImage, pose: np.ndarray, observation: Observation):
        seen, going, edge = self._seen, self._going, self.edge
        problem = edge.see(image, pose)
        if problem is not None:
            seen.problem = Reason(ReasonCode.BAD_IMAGE, problem.value)
            return
        picture = edge.picture
        seen.looked, seen.height = observation.arrival, picture.height
        seen.age += AGE_SHARE * (observation.age - seen.age)
        # Until the pad presses, the path is drawn anew with every image.
        settling = not going.begun and picture.force < PRESSED * self.goal.force
        sight, length = edge.follow(self.goal.direction, anew=settling), seen.load.length
        if sight.begun:
            going.ahead = going.here = edge.station
        if edge.followed:
            lateral, angle, length, slope = edge.at_picture(self.goal.direction, going.ahead)
        seen.load = Load(picture.force, length, picture.coming)
        seen.problem = None
        if sight.problem is None:
            seen.shown, seen.station = observation.arrival, edge.station
            seen.slope = seen.slope if sight.begun or math.isnan(slope) else slope
            self.error = TaskError(lateral, angle=angle, force=picture.force)
        else:
            seen.problem = Reason(UNFIT[sight.problem], sight.problem.value)
            if self.error is not None:
                self.error = self.error._replace(force=picture.force)

    def lacks(self, now: float) -> Reason | None:
        """What keeps the law from tracking, or None."""
        if now - self._seen.shown < self.servo.input.lost_after:
            return None
        return self._seen.problem or Reason(ReasonCode.EDGE_LOST)

    def assess(self, now: float, progress: float, load: float) -> Assessment:
        """Decide whether to go on."""
        self._going.progress = progress
        return within_goal(self.goal, self._laps, progress, self._assess(now, progress, load))

    def _assess(self, now, progress, load):
        going, edge = self._going, self.edge
        path, grain = edge.path, edge.scale.grain
        if self._stalled(now, progress):
            return Assessment(State.DONE, Reason(ReasonCode.NO_PROGRESS), lift=True)
        if now - self._seen.looked > STALE * self.servo.input.stale_image:
            return Assessment(State.HOLD, Reason(ReasonCode.STALE_IMAGE))
        if edge.closed and going.here >= path.closing:
            return Assessment(State.DONE, Reason(ReasonCode.CONTOUR_CLOSED), True)
        lacking, touching = self.lacks(now), load >= self.servo.approach.contact_force
        # A lightly pressed pad touches a crest only, and an edge seems to end beside it.
        going.pressed = going.pressed or (self._seen.load.force >= PRESSED * self.goal.force)
        if path.end is PathEnd.RIDGE and going.ahead >= path.tip - END_MARGIN * grain and (
                going.pressed or lacking is not None):
            return self._at_end(progress, touching)
        going.coasted = 0.0
        if lacking is None:
            going.searched, going.probed_from = 0.0, None
            going.mode = ReasonCode.TRACKING
            corner = edge.corner_at(going.ahead)
            return ON_EDGE if corner is None else (
                Assessment(State.CORNER, Reason(
                    ReasonCode.CORNER, f'{math.degrees(abs(corner.turn)):.0f} degrees')))
        if not touching:
            return self._probe() or Assessment(State.HOLD, Reason(ReasonCode.CONTACT_LOST))
        if edge.picture.pull is None or (
                going.searched > self.config.search.distance * edge.scale.half):
            return Assessment(State.HOLD, lacking)
        return self._search(ReasonCode.SEARCHING)

    def _stalled(self, now, progress):
        going, advance = self._going, ADVANCE * self.edge.scale.grain
        if (progress > going.reached + advance or going.mode != ReasonCode.TRACKING
                or going.reached_at is None):
            going.reached, going.reached_at = progress, now
        return now - going.reached_at > self.config.search.stall_time

    def _at_end(self, progress, touching):
        """Decide where the ridge ends: coast over a gap, go down a step, or end."""
        going, scale = self._going, self.edge.scale
        margin = END_MARGIN * scale.grain
        if going.coasted < self.config.search.coast * scale.half + margin and (
                touching or going.coasted <= margin):
            return self._search(ReasonCode.COASTING)
        if touching:
            return Assessment(State.DONE, Reason(
                ReasonCode.EDGE_LOST, 'no ridge goes on, but the pad is pressed'))
        return self._probe() or ended(self.goal, progress, 2.0 * scale.half)

    def _probe(self):
        """Go down for contact while the depth allows it, else None."""
        begin = self._going.probed_from
        if begin is not None and (
                self._going.depth - begin > PROBE * self.servo.force.press_depth):
            return None
        return self._search(ReasonCode.REACHING_DOWN)

    def _search(self, mode):
        self._going.mode = mode
        return Assessment(State.SEARCH, Reason(mode))

    def reference(self, pose: np.ndarray, commanded: np.ndarray, agility: Agility,
                  dt: float) -> Reference:
        """Wanted motion from the measured and the commanded pose (4, 4) of the sensor."""
        edge, going, before = self.edge, self._going, self._path.velocity
        soon = 1.0 / self.config.force.gain
        stand = edge.stand(pose, commanded, going.here, going.ahead,
                           (before[0] * soon, before[1] * soon))
        going.depth, going.begun = stand.there.item(2, 3), True
        normal, turn = 0.0, (0.0, 0.0, 0.0)
        if going.mode == ReasonCode.REACHING_DOWN:
            going.probed_from = going.depth if going.probed_from is None else going.probed_from
            self._planner.reset()
            velocity = self._path.change(0.0, 0.0, dt)
            normal = PROBE_SPEED * self.servo.approach.speed
        elif going.mode == ReasonCode.SEARCHING:
            speed = self._planner.search(self.goal.speed)
            going.searched += speed * dt
            x, y = edge.picture.pull.tolist()
            velocity = self._path.change(speed * x, speed * y, dt)
        else:
            velocity = self._along(stand, agility, dt)
            normal = self._normal(stand, dt)
        if going.mode == ReasonCode.TRACKING:
            turn = self._attitude.rate(
                stand.there, stand.way, self._seen.slope, self.goal.direction, dt)
        twist = np.empty(6)
        to_sensor(twist, stand.there, *velocity, normal, *turn)
        heading = edge.way_in_base(*stand.along)
        self._laps.see(pose[:3, 3].tolist(), pose[:3, 2].tolist(), heading, going.progress)
        return Reference(twist, self._planner.speed, heading)

    def _along(self, stand: Stand, agility: Agility, dt: float):
        """Velocity x, y along the path and back to it."""
        going, edge = self._going, self.edge
        going.here, going.ahead = stand.here, stand.ahead
        coasting = going.mode == ReasonCode.COASTING
        top = self._planner.top(
            self.goal.speed, pressed=self._seen.load.force / self.goal.force,
            distance=math.hypot(*stand.aside), coming=self._seen.load.coming, scale=edge.scale,
            age=self._seen.age, coasting=coasting)
        most = min(self.config.speed.acceleration, agility.across())
        self._planner.acceleration, self._path.acceleration = AGILE * most, most
        speed = self._planner.plan(edge, going.ahead, top, dt)
        if coasting:
            going.coasted += speed * dt
        way = edge.way(going.ahead, going.ahead + LOOK_AHEAD * edge.scale.grain + speed * dt)
        return self._path.follow(way, speed, stand.aside, dt)

    def _normal(self, stand: Stand, dt):
        """Velocity along the plane's normal that keeps the force."""
        seen, going, scale = self._seen, self._going, self.edge.scale
        give = self._force.speed(
            self.goal.force, seen.load, half=min(scale.half_x, scale.half_y), length=stand.length,
            pressed=going.depth - seen.height - seen.slope * (going.ahead - seen.station), dt=dt,
            # What touches, and is no edge, is no reason to press.
            may_press=going.mode != ReasonCode.COASTING and seen.problem is None)
        return self._force.bounded(give + seen.slope * self._planner.speed)

    def result(self) -> LawResult:
        """Whether the contour closed, and the edge in the base frame."""
        return LawResult(self.edge.closed, self.edge.contour())
