"""Pose-stamped tracing: the edge is mapped where the robot was when each picture was taken."""

from dataclasses import replace
import math

import numpy as np

from tactile_common.geometry import wrap_angle
from tactile_sensing.types.contact import ContactType
from tactile_servo.edge_map.edge_map import EdgeMap
from tactile_servo.edge_map.traced_path import PathEnd
from tactile_servo.laws.edge_following_config import TraceConfig
from tactile_servo.laws.resolved_rate import AGE_SHARE, EdgeFeatures
from tactile_servo.types import State, Verdict

TRACK, COAST, PULL, PROBE_DOWN = 'track', 'coast', 'pull', 'probe'
ON_EDGE = Verdict(State.TRACK, 'the edge goes on')
PRESSED = 0.6  # of the force, from which what is seen of the edge is all of it
PROBE = 0.9  # of the depth to which the servo may press
END_MARGIN = 4.0e-3  # m before the end of a ridge from which the pad coasts
SLOPE_REACH = 10.0e-3  # m either side of the pad over which the edge's rise is measured
LOOK_AHEAD = 0.4e-3  # m along the path over which its direction is taken
TURN_REACH = 4.0e-3  # m either side of the pad's centre over which the pad is turned
ENTRY_SPEED = 0.03  # m/s at which a second leg may come under the pad
COMING_SHARE = 0.35  # of its length that is given way to before
ANSWER = 5.0e-3  # s until the robot answers to what a picture showed
GIVE_WAY = 5.0  # times the gain of the force with which the pad gives way to a second leg
STRAY = 1.0e-3  # m from the path at which the pad no longer goes ahead


class Trace:
    """
    Follow the edge that the pictures drew, with the robot's own pose.

    The points of every picture are put into a plane fixed in the base by the pose at the
    picture's stamp, so that latency only ages what is seen ahead and is no part of the loop.

    Parameters
    ----------
    servo : EdgeServoConfig
    config : TraceConfig, optional
    """

    name = 'trace'
    sees_images = True
    closes_contours = True
    touch_speed = math.inf
    config_type = TraceConfig

    def __init__(self, servo, config=None):
        self.servo, self.config = servo, config or TraceConfig()
        self.begin(None)

    def refuse(self, goal):
        """Return why a goal is beyond this tracker, or ''."""
        return 'a closed contour has no length; let it be 0' * (goal.closed and goal.length > 0.0)

    def begin(self, goal):
        """Forget the last goal."""
        self.goal = goal
        self.features, self.arrival, self.reason = None, -np.inf, 'no picture yet'
        self.edge = EdgeMap(self.config.skin_stiffness)
        self._here = self._ahead = 0.0  # stations of the measured and the commanded pad [m]
        self._force = self._seen_z = self._seen_station = self._coming = 0.0
        self._stamp, self._seen_length, self._slope = None, 0.0, 0.0
        self._half = (self.servo.array_half_width,) * 2
        self._edge_seen = False
        self.looked, self._age = -np.inf, 0.0
        self._coasted = 0.0
        self.resume()

    def resume(self):
        """Go on from a standstill: from the measured pose, with the edge known so far."""
        self.speed = 0.0
        self._velocity = 0.0, 0.0  # in the plane
        self._turn = 0.0
        self._integral = 0.0
        self._mode = TRACK
        self._searched, self._probe_from = 0.0, None
        self._pressed = False
        self._reached, self._reached_at = 0.0, None

    def see_contact(self, contact, stamp_ns, arrival, age):
        """Take a contact estimate: a fitted line tells the force better than the sum does."""
        if (stamp_ns == self._stamp and contact.valid and contact.type == ContactType.LINE
                and abs(contact.normal_force - self._force) < 0.1 * self._force):
            self._force = contact.normal_force

    # Picture -----------------------------------------------------------------------------

    def see_image(self, image, pose, arrival, age=0.0):
        """Take a picture, the pose (4, 4) at its stamp, steady arrival time and age [s]."""
        edge = self.edge
        problem = edge.see(image, pose)
        if problem is not None:
            self.reason = problem.value
            return
        picture = edge.picture
        self._stamp, self._coming = image.stamp_ns, picture.coming
        self._half = picture.scale.half_x, picture.scale.half_y
        self._force = picture.force
        self.looked, self._seen_z = arrival, picture.height
        self._age += AGE_SHARE * (age - self._age)
        # Until the pad presses, the path is drawn anew with every picture.
        settling = self._ahead == 0.0 and self._force < PRESSED * self.goal.force
        sight = edge.follow(self.goal.direction, settling)
        self._edge_seen = sight.problem is None
        self.reason = '' if self._edge_seen else sight.problem.value
        if sight.begun:
            self._here = self._ahead = edge.station
        elif self._edge_seen:
            self._here = self._seen_station = edge.station
            slope = edge.slope(self._ahead, SLOPE_REACH)
            self._slope = slope if math.isfinite(slope) else self._slope
        if self._edge_seen:
            self.arrival = arrival
            self._describe(picture.pose)
        if edge.followed:
            self._seen_length = edge.length_on_pad(picture.pose)
        if self.features is not None:
            self.features = replace(self.features, force=self._force)

    def _describe(self, placed):
        at = self.edge.place(placed[:2, 3].tolist(), self._here, 10e-3)
        yaw = math.atan2(placed[0, 1], placed[1, 1])
        along = math.atan2(at.along_x * self.goal.direction, at.along_y * self.goal.direction)
        self.features = EdgeFeatures(
            self.goal.direction * at.left, wrap_angle(yaw - along), self._force,
            self.goal.direction * (self.edge.path.tip - at.station))

    # Decision ----------------------------------------------------------------------------

    def ready(self, now):
        """Whether there is an edge to track."""
        return now - self.arrival < self.servo.edge_lost

    def judge(self, now, pose, length, load):
        """Decide whether to go on tracking: Verdict."""
        edge, c = self.edge, self.config
        if length > self._reached + 1e-3 or self._mode != TRACK or not self._reached_at:
            self._reached, self._reached_at = length, now
        elif now - self._reached_at > c.stall_time:
            return Verdict(State.DONE, 'no progress along the edge', False, lift=True)
        # The servo itself holds when contacts stay away; this is for pictures alone.
        if now - self.looked > 1.5 * self.servo.stale_image:
            return Verdict(State.HOLD, 'tactile image is stale')
        if edge.closed and self._here >= edge.path.closing:
            return Verdict(State.DONE, 'the contour closed', True)
        beyond = -np.inf
        if edge.path is not None and edge.path.end is PathEnd.RIDGE:
            beyond = self._ahead - edge.path.tip
        # A lightly pressed pad touches a crest only, and an edge seems to end beside it.
        self._pressed = self._pressed or self._force >= PRESSED * self.goal.force
        if beyond >= -END_MARGIN and (self._pressed or not self.ready(now)):
            return self._judge_end(length, load)
        self._coasted = 0.0
        if self.ready(now):
            self._searched, self._probe_from = 0.0, None
            self._mode = TRACK
            corner = edge.corner_at(self._ahead)
            return ON_EDGE if corner is None else Verdict(
                State.CORNER, f'corner of {math.degrees(abs(corner.turn)):.0f} degrees')
        if load < self.servo.contact_force:
            return self._probe() or Verdict(State.HOLD, 'contact lost')
        if edge.picture.pull is None or self._searched > c.search_distance:
            return Verdict(State.HOLD, self.reason or 'edge lost')
        self._mode = PULL
        return Verdict(State.SEARCH, 'edge lost: moving to where the pressure is')

    def _judge_end(self, length, load):
        """Decide where the ridge ends: coast over a gap, go down a step, or end."""
        c = self.config
        if self._coasted < c.coast + END_MARGIN and not (
                load < self.servo.contact_force and self._coasted > END_MARGIN):
            self._mode = COAST
            return Verdict(State.SEARCH, 'the ridge ends: coasting')
        if load < self.servo.contact_force:
            verdict = self._probe()
            if verdict is not None:
                return verdict
        if load >= self.servo.contact_force:
            return Verdict(State.DONE, 'edge lost: no ridge goes on, but the pad is pressed')
        whole = (self.goal.length == 0.0 and not self.goal.closed
                 and length > 2.0 * self.servo.array_half_width)
        return Verdict(State.DONE, 'the edge ended', whole)

    def _probe(self):
        """Go down for contact while the depth allows it, else None."""
        if self._probe_from is not None and self._depth - self._probe_from > (
                PROBE * self.servo.press_depth):
            return None
        self._mode = PROBE_DOWN
        return Verdict(State.SEARCH, 'contact lost: going down')

    # Motion ------------------------------------------------------------------------------

    def twist(self, pose, commanded, dt):
        """
        Wanted twist of the sensor in its own frame (6,) [m/s, rad/s].

        pose, commanded : ndarray, shape (4, 4)
            Measured and commanded pose of the sensor.
        """
        here, there = self.edge.to_plane(pose), self.edge.to_plane(commanded)
        self._depth = there[2, 3]
        vx = vy = vz = 0.0
        if self._mode == PROBE_DOWN:
            self._probe_from = self._depth if self._probe_from is None else self._probe_from
            self.speed, vz = 0.0, 0.5 * self.servo.approach_speed
        elif self._mode == PULL:
            self.speed = min(self.config.search_speed, self.goal.speed)
            self._searched += self.speed * dt
            vx, vy = (self.speed * self.edge.picture.pull).tolist()
        else:
            vx, vy = self._in_plane(here, there, dt)
            vz = self._along_normal(there, dt)
        before_x, before_y = self._velocity
        most = self.config.acceleration * dt
        size = math.hypot(vx - before_x, vy - before_y)
        if size > most:
            vx = before_x + (vx - before_x) * (most / size)
            vy = before_y + (vy - before_y) * (most / size)
        self._velocity = vx, vy
        turn = self._rotate(there, dt) if self._mode == TRACK else (0.0, 0.0, 0.0)
        return (np.array([(vx, vy, vz), turn]) @ there[:3, :3]).reshape(6)

    def _in_plane(self, here, there, dt):
        """Velocity x, y along the path and back to it."""
        c, edge = self.config, self.edge
        px, py = here[:2, 3].tolist()
        at = edge.place((px, py), self._here, 15e-3)
        self._here, x, y = at.station, at.x, at.y
        self._ahead = edge.place(there[:2, 3].tolist(), self._ahead, 5e-3).station
        top = self.goal.speed
        if self._mode != COAST:
            top *= min(max(2.5 * self._force / self.goal.force - 0.75, 0.0), 1.0)
        # Pictures that come late show late what lies ahead.
        top = min(top, max(c.unseen / (self._age + ANSWER), ENTRY_SPEED))
        # A second leg that comes under the pad adds its load at once: give way first.
        top -= max(top - ENTRY_SPEED, 0.0) * min(self._coming / min(self._half), 1.0)
        top *= min(max(5.0 * (1.3 - self._force / self.goal.force), 0.0), 1.0)
        distance = math.hypot(x - px, y - py)
        top *= min(max(1.2 - distance / STRAY, 0.0), 1.0)
        end_speed = {PathEnd.CLOSED: top, PathEnd.RIDGE: min(c.search_speed, top),
                     PathEnd.VIEW: c.blind_speed}[edge.path.end]
        limit = edge.speed_limit(self._ahead, top, c.acceleration, end_speed, c.corner_cut,
                                 c.corner_settle)
        self.speed = min(limit, self.speed + c.acceleration * dt)
        if self._mode == COAST:
            self._coasted += self.speed * dt
        ux, uy = edge.way(self._ahead, self._ahead + LOOK_AHEAD + self.speed * dt)
        back = min(c.lateral_gain * distance, math.sqrt(c.acceleration * distance),
                   c.max_lateral_speed)
        back /= max(distance, 1e-9)
        return self.speed * ux + back * (x - px), self.speed * uy + back * (y - py)

    def _along_normal(self, there, dt):
        """Velocity along the plane's normal that keeps the force."""
        c = self.config
        slope = self._slope
        moved = (there[2, 3] - self._seen_z) - slope * (self._ahead - self._seen_station)
        shortest = 0.5 * min(self._half)
        vx, vy = self._velocity
        ahead = vx / c.force_gain, vy / c.force_gain
        length = max(self.edge.length_on_pad(there, ahead), shortest)
        predicted = self._force / max(self._seen_length, shortest) + c.skin_stiffness * moved
        # A share of what is to come is given way to before: as much too little first as it
        # is too much then.
        error = (self.goal.force / (length + COMING_SHARE * self._coming)
                 - max(predicted, 0.0)) / c.skin_stiffness
        if abs(self.goal.force - self._force) < 0.2 * self.goal.force:
            self._integral += (self.goal.force - self._force) / c.stiffness * dt
        # There is not much time, and what was moved since the picture is known: give way fast.
        gain = c.force_gain * (GIVE_WAY if self._coming > 0.0 and error < 0.0 else 1.0)
        give = gain * error + c.force_integral * self._integral
        # Pressing ends in time even for a robot that brakes this hard only.
        give = min(give, math.sqrt(2.0 * c.press_acceleration * max(error, 0.0))
                   + c.force_integral * abs(self._integral))
        if self._mode == COAST or not self._edge_seen:
            give = min(give, 0.0)  # what touches, and is no edge, is no reason to press
        speed = give + slope * self.speed
        return min(max(speed, -c.max_normal_speed), c.max_normal_speed)

    def _rotate(self, there, dt):
        """Angular velocity x, y, z in the plane's frame that turns and levels the pad."""
        c = self.config
        ux, uy = self.edge.way(self._ahead - TURN_REACH, self._ahead + TURN_REACH)
        sign = self.goal.direction
        heading = math.atan2(sign * there[1, 1], sign * there[0, 1])
        wanted = c.turn_gain * wrap_angle(math.atan2(uy, ux) - heading)
        wanted = min(max(wanted, -c.max_turn_rate), c.max_turn_rate)
        yaw = math.atan2(there[1, 0], there[0, 0])
        if abs(yaw) > c.max_turn and wanted * yaw > 0.0:
            wanted = 0.0
        change = c.turn_acceleration * dt
        self._turn += min(max(wanted - self._turn, -change), change)
        # The pad's normal n is brought square to the edge, t, and to what lies across it, s:
        # n turns by -(n t) t with the rate of turn -(n t) n x t.
        nx, ny, nz = there[:3, 2].tolist()
        tilt = (nx * ux + ny * uy + nz * self._slope) / (1.0 + self._slope**2)
        lean = ny * ux - nx * uy
        x, y, z = (min(max(-c.turn_gain * rate, -c.max_turn_rate), c.max_turn_rate) for rate in (
            tilt * (ny * self._slope - nz * uy) - lean * nz * ux,
            tilt * (nz * ux - nx * self._slope) - lean * nz * uy,
            tilt * (nx * uy - ny * ux) + lean * (nx * ux + ny * uy)))
        return x, y, z + self._turn

    @property
    def closed(self):
        """Whether the path has met its start."""
        return self.edge.closed

    def heading(self, pose):
        """Direction of travel in the base frame (3,)."""
        heading = self.edge.heading(pose)
        return self.goal.direction * pose[:3, 1] if heading is None else heading

    def contour(self):
        """Rebuilt edge in the base frame, shape (N, 3)."""
        return self.edge.contour()
