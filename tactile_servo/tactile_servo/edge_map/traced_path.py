"""Path of an edge in its plane, traced anew ahead of the pad with every picture."""

from enum import Enum
from typing import NamedTuple

import numpy as np

from tactile_servo.edge_map import ends
from tactile_servo.edge_map.corner import Corner, fit, shown
from tactile_servo.edge_map.ends import TIP
from tactile_servo.edge_map.path import closing_node, entry_node, FAR_TURN, measure, unblurred
from tactile_servo.edge_map.picture import Picture
from tactile_servo.edge_map.records import joined
from tactile_servo.edge_map.tracing import STEP, trace

DENIALS = 3  # pictures one after the other that show no such corner, until it is dropped

BLUR = 0.6  # of the squared depth over the radius: how far a ridge lies inside of a curve
SEEN_BORDER = 1.65  # depths from the pad's border where a ridge looks as it does at its end

# In grains, see `PadScale`: where what is near cannot be told apart.
KEEP_BEHIND = 1.0  # behind the pad's centre the path is no longer changed
SAME_CORNER = 1.5  # between vertices of what may be one corner
ZONE_BEHIND, ZONE_ASIDE = 1.0, 1.25  # of a corner's vertex, where a leg has entered its zone
PASSED = 2.0  # behind the pad a corner is no longer fitted
CLOSING = 0.6  # from the start within which a contour closes
UNSURE_START = 2.0  # of a path at its start that a moving pad has not seen long enough

PAST_CORNER = 11.0  # depths of path traced at the least: through a corner and out of it again

# In half sizes of the pad: what it can see, and what it must have left behind.
AHEAD = 22.0 / 12.7  # of path traced at the most: to a corner of the pad, and a share more
BEHIND = 30.0 / 12.7  # around the pad of which the load is reckoned
SHORTEST_CONTOUR = 50.0 / 12.7  # nearly twice the pad: what is smaller has no edge to follow


class PathEnd(Enum):
    """Why a path ends."""

    VIEW = 'the pad sees no further'
    RIDGE = 'the ridge ends; the last chord only leads straight on'
    CLOSED = 'it has met its start'


class Piece(NamedTuple):
    """Nodes of a path, and the corner that they are, if they are one."""

    nodes: np.ndarray
    corner: Corner | None = None


class TracedPath:
    """
    Path that begins at a node (1,) of the ridge, whose station counts, traced through a cloud.

    It may not close if it does not begin at the start of the contour.
    """

    def __init__(self, start: np.ndarray, cloud: np.ndarray, picture: Picture,
                 may_close: bool = True):
        self.scale, self.may_close = picture.scale, may_close
        self.corners: list[Corner] = []
        self.end = PathEnd.VIEW
        self.closing: float | None = None  # station at which the pad meets its own start [m]
        self.contour: np.ndarray | None = None  # NODE (N,), one round of a closed path
        against = start.copy()
        against['way'] *= -1.0
        back = trace(cloud, against, self._ahead, self.scale.grain)[::-1].copy()
        back['way'] *= -1.0
        # Whether the edge may go on before the first node.
        self.open_start = not len(back) or not self._well_inside(picture, back[:1])
        self.nodes = joined([back, start])
        (self.began,) = start['station'].tolist()
        self._measure(self.began - len(back) * self._step)
        self.tip = 0.0  # station of the last node that was seen [m]
        self.extend(cloud, picture, self.began)

    @property
    def _step(self):
        return STEP * self.scale.grain

    @property
    def _ahead(self):
        return max(AHEAD * self.scale.half, PAST_CORNER * self.scale.depth)

    def _measure(self, first):
        measure(self.nodes, first)

    @staticmethod
    def _well_inside(picture, node):
        return picture.covers(node['place'], SEEN_BORDER * picture.depth)

    def extend(self, cloud: np.ndarray, picture: Picture, station: float):
        """Trace anew what lies ahead of a station [m]."""
        if self.end is PathEnd.CLOSED:
            return
        stations, behind = self.nodes['station'], station - KEEP_BEHIND * self.scale.grain
        first = stations[0]
        kept = max(int(np.searchsorted(stations, behind)), 1)
        for corner in self.corners:
            if corner.entry < stations[kept - 1] < corner.leave:
                kept = max(int(np.searchsorted(stations, corner.entry + 1e-9)), 1)
        head = self.nodes[:kept]
        ended = self.end is PathEnd.RIDGE and behind > self.tip
        pieces = self._trace_on(cloud, picture, head, station)
        for _ in range(2):
            if not self._find_corner(cloud, picture, head, pieces):
                break
            pieces = self._trace_on(cloud, picture, head, station)
        if ended and sum(len(piece.nodes) for piece in pieces) < TIP:
            # A few nodes where the ridge faded do not say that it goes on, nor where to.
            pieces, self.end = [], PathEnd.RIDGE
        self.nodes = joined([head, *(piece.nodes for piece in pieces)])
        self._measure(first)
        stations, at = self.nodes['station'], kept
        for piece in pieces:
            if piece.corner is not None:
                piece.corner.entry = stations[at - 1]
                piece.corner.leave = stations[at + len(piece.nodes) - 1]
            at += len(piece.nodes)
        self.tip = float(stations[-1])
        self._close(station)
        if self.end is PathEnd.RIDGE:
            self.nodes = ends.led_on(self.nodes, BEHIND * self.scale.half)
            self._measure(first)

    def _trace_on(self, cloud, picture, head, station):
        """Legs, corners and ways over gaps that follow: list of Piece."""
        scale, last, pieces, left = self.scale, head[-1:], [], self._ahead
        # Not those just passed; one passed long ago may come again, round a contour.
        passed, again = -KEEP_BEHIND * scale.grain, -SHORTEST_CONTOUR * scale.half
        corners = [corner for corner in self.corners
                   if not again < corner.leave - station < passed]
        self.end = PathEnd.VIEW
        while left > 0.0:
            leg = joined([last, trace(cloud, last, left, scale.grain)])
            corner, cut = self._next_corner(leg, corners)
            if cut:
                leg = leg[:cut + 1]
                pieces.append(Piece(unblurred(
                    leg, BLUR * scale.depth**2, self._step, scale.depth)[1:]))
                last = leg[-1:]
            left -= cut * self._step
            if corner is None:
                end = pieces[-1].nodes[-1:] if pieces else head[-1:]
                jump = self._jump(cloud, picture, end) if left > 0.0 else None
                if jump is None:
                    break
                pieces.append(Piece(jump))
                left -= np.hypot(*(jump['place'][-1] - jump['place'][0]))
                last = jump[-1:]
                continue
            corners.remove(corner)
            turn = corner.nodes()
            # Of a corner that is found late a part lies behind: the path must not lead back.
            turn = turn[int(((turn['place'] - last['place']) @ last['way'][0] > 0.0).argmax()):]
            turn['z'] = last['z']
            pieces.append(Piece(turn, corner))
            left -= 2.0 * corner.reach
            last = turn[-1:]
        if self.end is PathEnd.RIDGE:
            self._trim(head, pieces, picture.height)
        return pieces

    def _next_corner(self, leg, corners):
        """First corner whose zone a leg enters, and how many nodes lie before, after its start."""
        best, cut, grain = None, len(leg) - 1, self.scale.grain
        for corner in corners:
            shape = corner.shape
            first = entry_node(leg, shape.x, shape.y, shape.first, corner.reach,
                               ZONE_BEHIND * grain, ZONE_ASIDE * grain)
            if first >= 0 and (best is None or first - 1 < cut):
                best, cut = corner, max(first - 1, 0)
        return best, cut

    def _jump(self, cloud, picture, last):
        """Nodes over a gap, or None: the path ends with the view or with the ridge."""
        if not self._well_inside(picture, last) and (
                (last['place'][0] - picture.place) @ last['way'][0] > 0.0):  # ahead of the pad
            return None
        jump = ends.way_over_gap(cloud, last, self.scale)
        self.end = PathEnd.RIDGE if jump is None else PathEnd.VIEW
        return jump

    @staticmethod
    def _trim(head, pieces, height):
        """Take off the tip of a ridge that ends."""
        if not pieces:
            return
        count = ends.faded(joined([head[-3 * TIP:], *(piece.nodes for piece in pieces)]), height)
        while count and pieces:
            nodes, corner = pieces.pop()
            if len(nodes) > count:
                pieces.append(Piece(nodes[:len(nodes) - count], corner))
            count -= min(count, len(nodes))

    def _find_corner(self, cloud, picture, head, pieces):
        """Look for a corner in the last leg, or beyond its end; whether one was added."""
        if not pieces:
            return False
        behind = pieces[-2].nodes if len(pieces) > 1 else head
        leg = joined([behind[-FAR_TURN:], pieces[-1].nodes])
        guesses = [ends.sharp_turn(leg, self.scale.depth)]
        if self.end is PathEnd.RIDGE:
            guesses.append(ends.acute_turn(cloud, leg, self.scale))
        for shape in guesses:
            if shape is None or any(self._apart(shape, other) < SAME_CORNER * self.scale.grain
                                    for other in self.corners):
                continue
            fitted = fit(picture, shape)
            if fitted is None:
                continue
            corner = Corner(*fitted, self.scale.depth)
            # The zones of two corners must not overlap, or the path would lead back.
            if all(self._apart(corner.shape, other) > corner.reach + other.reach
                   for other in self.corners):
                self.corners.append(corner)
                return True
        return False

    @staticmethod
    def _apart(shape, corner):
        return np.hypot(*(shape.vertex - corner.shape.vertex))

    def refine(self, picture: Picture, station: float):
        """Fit the corners in view to the newest picture; drop those ahead that it denies."""
        for corner in list(self.corners):
            if (corner.leave < station - PASSED * self.scale.grain
                    or not shown(picture, corner.shape)):
                continue
            fitted = fit(picture, corner.shape)
            if fitted is not None:
                corner.merge(*fitted)
                corner.denied = 0
            elif corner.entry + corner.leave > 2.0 * station:  # its vertex is still ahead
                corner.denied += 1
                if corner.denied >= DENIALS:
                    self.corners.remove(corner)

    def _close(self, station):
        """Close the contour where the path meets its start."""
        shortest = SHORTEST_CONTOUR * self.scale.half
        if not self.may_close or station - self.began < shortest:
            return
        # Behind where it began the path was seen from one place only.
        stations, unsure = self.nodes['station'], UNSURE_START * self.scale.grain
        first, begin = stations[0], max(stations[0], self.began) + unsure
        k = closing_node(self.nodes, station, begin, CLOSING * self.scale.grain)
        if k < 0:
            return
        again = (stations >= begin) & (stations < begin + BEHIND * self.scale.half)
        self.closing = float(stations[k] - unsure)  # where the pad itself began
        self.contour = self.nodes[:k][stations[:k] >= begin]
        self.nodes = joined([self.nodes[:k], self.nodes[again]])
        self._measure(first)
        self.end = PathEnd.CLOSED
