"""The edge as traced so far: a path behind and under the pad, and what is seen ahead."""

import math

import numpy as np

from tactile_servo.edge_map.corner import Corner, guess, LEAST_TURN
from tactile_servo.edge_map.path import (
    closing_node,
    FAR_TURN,
    nodes_from,
    sharpest_turn,
    stations_of,
    unblurred,
)
from tactile_servo.edge_map.tracing import (
    length_on_pad,
    local_line,
    place_at,
    project,
    rise,
    share_near,
    speed_profile,
    STEP,
    trace,
)

KEEP_BEHIND = 2.0e-3  # m behind the pad's centre the path is no longer changed
AHEAD = 22.0e-3  # m of path traced at the most
PICTURES = 10  # whose points make the cloud
SEEN_BORDER = 3.3e-3  # m from the pad's border where a ridge can no longer be told from its end
BLUR = 0.6  # of the squared depth over the radius: how far a ridge lies inside of a curve [m^2]
BRANCH_REACH = 6.0e-3  # m from the end of a ridge within which another leg is looked for
TIP = 8  # nodes at the end of a ridge among which it fades
DENIALS = 3  # pictures one after the other that show no such corner, until it is dropped
OFF_PATH = 2.0e-3  # m from the path beyond which a point is not of it
GAP_REACH = 18.0e-3  # m ahead over which a ridge may go on
BESIDE = 1.3e-3  # m from the path beyond which a point belongs to another leg
BEHIND = 30.0e-3  # m around the pad of which the load is reckoned
CLOSING = 1.2e-3  # m from the start within which a contour closes
UNSURE_START = 4.0e-3  # m of a path at its start that a moving pad has not seen long enough
SHORTEST_CONTOUR = 0.05  # m
VIEW, END, CLOSED = 'view', 'end', 'closed'


class TracedEdge:
    """
    Path of an edge in a plane, traced picture by picture.

    Attributes
    ----------
    nodes : ndarray, shape (N, 6)
        x, y, z (along the plane's normal) [m], direction x, y, and whether there is material
        between the node and the one before: 1 or 0.
    stations : ndarray, shape (N,)
        Way along the path [m].
    end : str
        Why the path ends: VIEW (the pad sees no further), END (the ridge ends; the last chord
        only leads straight on), CLOSED.
    tip : float
        Station of the last node that was seen [m].
    """

    def __init__(self, depth):
        self.blur = BLUR * depth**2
        self.nodes = np.empty((0, 6))
        self.stations = np.empty(0)
        self.corners = []
        self.end, self.tip = VIEW, 0.0
        self.past = []  # nodes of earlier paths, before a slip
        self._clouds = []
        self._cloud = np.empty((0, 6))
        self._picture = None
        self._near = np.empty((0, 6))

    # Input -------------------------------------------------------------------------------

    def see(self, cloud, picture):
        """Take the points (N, 6) of a picture, see `edge_trace`, and the Picture itself."""
        self._clouds = [*self._clouds[1 - PICTURES:], cloud]
        self._cloud = np.concatenate(self._clouds)
        self._picture = picture

    def forget(self):
        """Drop what earlier pictures showed: the object has moved."""
        self._clouds = self._clouds[-1:]
        self._cloud = np.concatenate(self._clouds) if self._clouds else np.empty((0, 6))
        self.past.append(self.nodes)
        self.corners = []

    def agrees(self):
        """Whether the newest picture shows the path where it is thought to be."""
        points = self._clouds[-1]
        return share_near(points, self._near, OFF_PATH) > 0.4

    def seed(self, place, heading, station=0.0):
        """
        Begin a path at the point of the ridge that is nearest to a place (2,).

        Returns
        -------
        bool
            Whether there is one whose ridge runs roughly along `heading` (2,).
        """
        cloud = self._cloud
        along = np.abs(cloud[:, 3:5] @ heading) > 0.5
        if not along.any():
            return False
        cloud = cloud[along]
        nearest = cloud[np.linalg.norm(cloud[:, :2] - place, axis=1).argmin()]
        found, x, y, z, tx, ty = local_line(self._cloud, *nearest[:2], *heading)
        if not found:
            return False
        back = trace(self._cloud, x, y, -tx, -ty, AHEAD)[::-1]
        self._began = station
        self._open_start = not len(back) or not self._picture.covers(back[:1, :2], SEEN_BORDER)
        back[:, 3:5] *= -1.0
        self.end = VIEW
        self.nodes = np.vstack([back, [[x, y, z, tx, ty, 1.0]]])
        self._measure(station - len(back) * STEP)
        self.corners = []
        self.extend(station)
        return True

    # Path --------------------------------------------------------------------------------

    def _measure(self, first=None):
        if first is None:
            first = self.stations[0] if len(self.stations) else 0.0
        self.stations = stations_of(self.nodes, first)

    def extend(self, station):
        """Trace anew what lies ahead of a station [m]."""
        if self.end == CLOSED:
            self._take_near(station)
            return
        kept = max(int(np.searchsorted(self.stations, station - KEEP_BEHIND)), 1)
        for corner in self.corners:
            entry, leave = corner.span
            if entry < self.stations[kept - 1] < leave:
                kept = max(int(np.searchsorted(self.stations, entry + 1e-9)), 1)
        head = self.nodes[:kept]
        ended = self.end == END and station - KEEP_BEHIND > self.tip
        ways, found = self._trace_on(head, station)
        for _ in range(2):
            if not self._find_corner(head, ways):
                break
            ways, found = self._trace_on(head, station)
        if ended and sum(len(way) for way in ways) < TIP:
            # A few nodes where the ridge faded do not say that it goes on, nor where to.
            ways, found, self.end = [], [], END
        self.nodes = np.vstack([head, *ways])
        self._measure()
        at = kept
        for way, corner in zip(ways, found, strict=True):
            if corner is not None:
                corner.span = self.stations[at - 1], self.stations[at + len(way) - 1]
            at += len(way)
        self.tip = self.stations[-1]
        self._close(station)
        self._go_on()
        self._take_near(station)

    def _trace_on(self, head, station):
        """Legs and corners (each (M, 6)) that follow, and the Corner that each one is."""
        x, y, z, tx, ty, _ = head[-1]
        ways, found, left = [], [], AHEAD
        # Not those just passed; one passed long ago may come again, round a contour.
        open_corners = [corner for corner in self.corners
                        if not -SHORTEST_CONTOUR < corner.span[1] - station < -KEEP_BEHIND]
        self.end = VIEW
        while left > 0.0:
            leg = trace(self._cloud, x, y, tx, ty, left)
            start = np.array([[x, y, z, tx, ty, 1.0]])
            corner, cut = self._next_corner(np.vstack([start, leg]), open_corners)
            leg = leg[:cut]
            if len(leg):
                ways.append(unblurred(np.vstack([start, leg]), self.blur, STEP)[1:])
                found.append(None)
                x, y, z, tx, ty, _ = leg[-1]
            left -= len(leg) * STEP
            if corner is None:
                jump = None if left <= 0.0 else self._jump(ways[-1][-1] if ways else head[-1])
                if jump is None:
                    break
                ways.append(jump)
                found.append(None)
                left -= np.linalg.norm(jump[-1, :2] - jump[0, :2])
                x, y, z, tx, ty, _ = jump[-1]
                continue
            open_corners.remove(corner)
            turn = corner.nodes()
            # Of a corner that is found late a part lies behind: the path must not lead back.
            turn = turn[int(((turn[:, :2] - (x, y)) @ (tx, ty) > 0.0).argmax()):]
            way = np.column_stack([
                turn[:, :2], np.full(len(turn), z), turn[:, 2:], np.ones(len(turn))])
            ways.append(way)
            found.append(corner)
            left -= 2.0 * corner.reach
            x, y, _, tx, ty, _ = way[-1]
        self._trim(head, ways, found)
        return ways, found

    @staticmethod
    def _next_corner(leg, corners):
        """First corner whose zone a leg enters, and how many nodes lie before."""
        best = None, len(leg) - 1
        for corner in corners:
            relative = leg[:, :2] - corner.vertex
            way = corner.arriving
            ahead = -(relative @ way)
            aside = np.abs(relative @ np.array([-way[1], way[0]]))
            inside = (ahead < corner.reach) & (ahead > -2e-3) & (aside < 2.5e-3)
            if inside.any():
                first = int(inside.argmax())
                if best[0] is None or first - 1 < best[1]:
                    best = corner, max(first - 1, 0)
        return best

    # Ends --------------------------------------------------------------------------------

    def _go_on(self):
        """Lead the path straight on beyond the end of the ridge, for the pad to coast along."""
        if self.end != END:
            return
        # Single nodes are uncertain where a ridge fades: means of several give the line.
        last, tail = self.nodes[-1], self.nodes[-2 * TIP:, :2]
        half = len(tail) // 2
        middle = tail[half:].mean(axis=0)
        way = middle - tail[:half].mean(axis=0) if half else last[3:5]
        size = np.hypot(*way)
        way = way / size if size > 0.0 else last[3:5]
        there = middle + (BEHIND + (last[:2] - middle) @ way) * way
        self.nodes = np.vstack([self.nodes, [*there, last[2], *way, 0.0]])
        self._measure()

    def _trim(self, head, ways, found):
        """Take off the tip of a ridge that ends: it reaches beyond the edge by its blur."""
        if self.end != END or not ways:
            return
        leg = np.vstack([head, *ways])[-3 * TIP:]
        indentation = self._picture.depth_of_pad - leg[:, 2]
        if len(leg) < 3 * TIP:
            return
        # At the end of a line load its pressure is half of that along it.
        faint = indentation < 0.5 * np.median(indentation[:2 * TIP])
        count = int(faint[::-1].argmin()) if not faint.all() else 0
        while count and ways:
            taken = min(count, len(ways[-1]))
            ways[-1] = ways[-1][:len(ways[-1]) - taken]
            count -= taken
            if not len(ways[-1]):
                ways.pop()
                found.pop()

    def _jump(self, last):
        """Way over a gap to where the ridge goes on straight ahead, or None."""
        ahead_of_pad = (last[:2] - self._picture.place) @ last[3:5] > 0.0
        if ahead_of_pad and not self._picture.covers(last[None, :2], SEEN_BORDER):
            return None
        self.end = END
        relative = self._cloud[:, :2] - last[:2]
        way = last[3:5]
        ahead = relative @ way
        aside = np.abs(relative @ np.array([-way[1], way[0]]))
        on = ((ahead > 2.0 * STEP) & (ahead < GAP_REACH) & (aside < 0.8e-3 + 0.08 * ahead)
              & (np.abs(self._cloud[:, 3:5] @ way) > 0.92))
        if on.sum() < 3:
            return None
        nearest = self._cloud[on][ahead[on].argmin()]
        found, x, y, z, tx, ty = local_line(self._cloud, *nearest[:2], *way)
        if not found:
            return None
        self.end = VIEW
        count = max(int(np.hypot(x - last[0], y - last[1]) / STEP), 1)
        share = np.linspace(0.0, 1.0, count + 1)[1:, None]
        nodes = last + share * (np.array([x, y, z, tx, ty, 0.0]) - last)
        nodes[:, 3:] = tx, ty, 0.0
        return nodes

    def _find_corner(self, head, ways):
        """Look for a corner in the last leg, or beyond its end; whether one was added."""
        if not ways or self._picture is None:
            return False
        behind = head[-FAR_TURN:] if len(ways) == 1 else ways[-2][-FAR_TURN:]
        leg = np.vstack([behind, ways[-1]])
        guesses = [self._sharp_turn(leg), self._branch(leg)]
        for p in guesses:
            if p is None or any(np.hypot(*(p[:2] - other.vertex)) < 3e-3
                                for other in self.corners):
                continue
            fitted = self._picture.fit(p)
            if fitted is None:
                continue
            corner = Corner(*fitted)
            corner.span = np.inf, np.inf
            # The zones of two corners must not overlap, or the path would lead back.
            if all(np.hypot(*(corner.vertex - other.vertex)) > corner.reach + other.reach
                   for other in self.corners):
                self.corners.append(corner)
                return True
        return False

    @staticmethod
    def _sharp_turn(leg):
        """Guess of a corner where a leg turns most, or None."""
        first, last = sharpest_turn(leg, 0.8 * LEAST_TURN)
        if first < 0:
            return None
        return guess(leg[first, :2], leg[first, 3:5], leg[last, :2], leg[last, 3:5])

    def _branch(self, leg):
        """Guess of an acute corner: another leg that begins where this one ends, or None."""
        if self.end != END or len(leg) < 8:
            return None
        last = leg[-1, :2]
        cloud = self._cloud
        close = np.linalg.norm(cloud[:, :2] - last, axis=1) < BRANCH_REACH
        away = np.min(np.linalg.norm(
            cloud[:, None, :2] - leg[None, -30:, :2], axis=2), axis=1) > BESIDE
        others = cloud[close & away]
        if len(others) < 3:
            return None
        centre = others[:, :2].mean(axis=0)
        way = others[0, 3:5]
        way = (others[:, 3:5] * np.sign(others[:, 3:5] @ way)[:, None]).mean(axis=0)
        way /= np.linalg.norm(way)
        if way @ (centre - last) < 0.0:
            way = -way
        before = leg[max(len(leg) - 10, 0)]
        return guess(before[:2], before[3:5], centre, way)

    def refine(self, station):
        """Fit the corners in view to the newest picture; drop those ahead that it denies."""
        for corner in list(self.corners):
            if corner.span[1] < station - 4e-3 or not self._picture.shows(corner.p):
                continue
            fitted = self._picture.fit(corner.p)
            if fitted is not None:
                corner.merge(*fitted)
                corner.denied = 0
            elif sum(corner.span) > 2.0 * station:  # its vertex is still ahead
                corner.denied += 1
                if corner.denied >= DENIALS:
                    self.corners.remove(corner)

    def _close(self, station):
        """Close the contour where the path meets its start."""
        if station - self._began < SHORTEST_CONTOUR or self.past:
            return
        # Behind where it began the path was seen from one place only.
        begin = max(self.stations[0], self._began) + UNSURE_START
        k = closing_node(self.nodes, self.stations, station, begin, CLOSING)
        if k < 0:
            return
        again = (self.stations >= begin) & (self.stations < begin + BEHIND)
        self.closing = self.stations[k] - UNSURE_START  # where the pad itself began
        self.contour_nodes = self.nodes[:k][self.stations[:k] >= begin]
        self.nodes = np.vstack([self.nodes[:k], self.nodes[again]])
        self._measure()
        self.end = CLOSED

    # Use ---------------------------------------------------------------------------------

    def place(self, xy, station, window):
        """Project a point (2,) onto the path near a station; see `edge_trace.project`."""
        return project(self.nodes, self.stations, xy[0], xy[1], station - window,
                       station + window)

    def speed_limit(self, station, top, acceleration, end_speed, cut, settle):
        """Largest speed at a station [m/s]; see `edge_trace.speed_profile`."""
        seen = len(self.nodes) - (self.end == END)
        return speed_profile(self.nodes[:seen], self.stations[:seen], station, top,
                             acceleration, end_speed, cut, settle)

    def along(self, station):
        """Place (x, y, z) of the path at a station [m]."""
        return place_at(self.nodes, self.stations, station)

    def corner_at(self, station):
        """Corner that stands for the edge at a station [m], or None."""
        return next((corner for corner in self.corners
                     if corner.span[0] <= station <= corner.span[1]), None)

    def slope(self, station, reach):
        """Rise of the edge along itself around a station; see `edge_trace.rise`."""
        return rise(self.nodes, self.stations, station, reach, self.end == END)

    def length_on_pad(self, place, yaw, half):
        """Length of the traced edge under a pad at a place (2,) and yaw, half (2,) its size."""
        return length_on_pad(self._near, *place, math.cos(yaw), math.sin(yaw), *half)

    def _take_near(self, station):
        """Remember the path around the pad, and beyond what is seen of it straight on."""
        self._near = nodes_from(self.nodes, self.stations, station - BEHIND, BEHIND,
                                self._open_start, self.end == VIEW)
