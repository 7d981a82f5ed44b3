"""Path of an edge in its plane; every image replaces the part ahead of the pad."""

from enum import Enum
from itertools import pairwise
import math
from typing import NamedTuple

import numpy as np

from tactile_servo.edge_map import path
from tactile_servo.edge_map.corner import Corner, CornerShape, fit, shown
from tactile_servo.edge_map.path import FAR_TURN, measure, TIP
from tactile_servo.edge_map.picture import Picture
from tactile_servo.edge_map.records import joined
from tactile_servo.edge_map.tracing import STEP, trace

DENIALS = 3  # successive images without a corner after which it is removed
PAST_CORNER = 11.0  # depths ahead of the pad that are traced at least: through a corner
BLUR = 0.6  # distance by which a ridge is inside of a curve, times its radius over depth^2

# Distances in grains, the resolution, see `PadScale`:
SEEN_BORDER = 1.65  # from the pad's border, within which a ridge seems to end
KEEP_BEHIND = 1.0  # behind the pad's centre, from where on the path is no longer changed
CLOSING = 0.6  # from the start, within which a contour closes
SAME_CORNER = 1.5  # between two vertices, within which they belong to the same corner
CORNER_BEHIND = 2.0  # behind the pad, from where on a corner is no longer fitted
UNSURE_START = 2.0  # from the start: a moving pad has not seen this part for long enough

# Distances in half sizes of the pad:
TRACED = 22.0 / 12.7  # ahead of the pad, that is traced: beyond a corner of the pad
BEHIND = 30.0 / 12.7  # around the pad, within which the path is used for the load
SHORTEST_CONTOUR = 50.0 / 12.7  # nearly two pads: smaller objects have no edge to follow


class PathEnd(Enum):
    """Why a path ends."""

    VIEW = 'the pad sees no further'
    RIDGE = 'the ridge ends; the last chord only leads straight on'
    CLOSED = 'it has met its start'


class PathPart(NamedTuple):
    """Part of a path: its first node, and its corner if the part is one."""

    first: int
    corner: Corner | None = None


class TracedPath:
    """
    Path from a node (1,) of the ridge with its station, traced through a cloud.

    With `may_close` false it does not close: then it does not begin at the contour's start.
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
        # True if the edge may continue before the first node.
        x, y = back['place'][0].tolist() if len(back) else (math.inf, math.inf)
        self.open_start = not picture.covers(x, y, SEEN_BORDER * self.scale.grain)
        self.nodes = joined([back, start])
        (self.began,) = start['station'].tolist()
        self.nodes['station'][0] = self.began - len(back) * self._step
        measure(self.nodes, 1)
        self.tip = 0.0  # station of the last traced node [m]
        self.extend(cloud, picture, self.began)

    @property
    def _step(self) -> float:
        return STEP * self.scale.grain

    @property
    def _ahead(self) -> float:
        """Traced distance [m]: beyond a corner of the pad, or through a corner of the edge."""
        return max(TRACED * self.scale.half, PAST_CORNER * self.scale.depth)

    def extend(self, cloud: np.ndarray, picture: Picture, station: float) -> None:
        """Trace the path ahead of a station [m] again."""
        if self.end is PathEnd.CLOSED:
            return
        stations, behind = self.nodes['station'], station - KEEP_BEHIND * self.scale.grain
        kept = max(int(stations.searchsorted(behind)), 1)
        for corner in self.corners:
            if corner.entry < stations[kept - 1] < corner.leave:
                kept = max(int(stations.searchsorted(corner.entry + 1e-9)), 1)
        head = self.nodes[:kept]
        ended = self.end is PathEnd.RIDGE and behind > self.tip
        nodes, pieces = self._trace_on(cloud, picture, head, station)
        for _ in range(2):
            if not self._find_corner(cloud, picture, nodes, pieces):
                break
            nodes, pieces = self._trace_on(cloud, picture, head, station)
        if ended and len(nodes) - kept < TIP:
            # A few nodes where the ridge faded do not show that it continues, or where.
            nodes, pieces, self.end = head, [], PathEnd.RIDGE
        self.nodes, stations = nodes, nodes['station']
        for piece, after in pairwise([*pieces, PathPart(len(nodes))]):
            if piece.corner is not None:
                piece.corner.entry = stations[piece.first - 1]
                piece.corner.leave = stations[after.first - 1]
        self.tip = stations.item(-1)
        self._close(station)
        if self.end is PathEnd.RIDGE:
            self.nodes = path.led_on(self.nodes, BEHIND * self.scale.half)
            measure(self.nodes, len(self.nodes) - 1)

    def _trace_on(self, cloud: np.ndarray, picture: Picture, head: np.ndarray,
                  station: float) -> tuple[np.ndarray, list[PathPart]]:
        """Add the legs, corners and gaps that follow; return nodes and pieces."""
        nodes, pieces, left, corners = head, [], self._ahead, self._to_come(station)
        self.end = PathEnd.VIEW
        while left > 0.0:
            first = len(nodes)
            leg, corner = self._leg(cloud, nodes[-1:], left, corners)
            nodes = joined([nodes, leg])
            if len(leg):
                pieces.append(PathPart(first))
            left -= len(leg) * self._step
            last, first = nodes[-1:], len(nodes)
            if corner is None:
                jump = self._jump(cloud, picture, last) if left > 0.0 else None
                if jump is None:
                    break
                pieces.append(PathPart(first))
                left -= np.hypot(*(jump['place'][-1] - jump['place'][0]))
                nodes = joined([nodes, jump])
            else:
                corners.remove(corner)
                turn = corner.nodes()
                # A part of a corner that is found late is behind: the path must not turn back.
                ahead = (turn['place'] - last['place']) @ last['way'][0] > 0.0
                turn = turn[int(ahead.argmax()):]
                turn['z'] = last['z']
                pieces.append(PathPart(first, corner))
                left -= 2.0 * corner.reach
                nodes = joined([nodes, turn])
        measure(nodes, len(head))
        if self.end is PathEnd.RIDGE and pieces:
            nodes = self._trimmed(nodes, pieces, picture.height)
        return nodes, pieces

    def _leg(self, cloud: np.ndarray, last: np.ndarray, length: float,
             corners: list[Corner]) -> tuple[np.ndarray, Corner | None]:
        """Trace a leg from a node (1,) up to the first corner; return its nodes and the corner."""
        scale = self.scale
        leg = joined([last, trace(cloud, last, length, scale.grain)])
        end, entered = len(leg), None
        for corner in corners:
            inside = corner.entered(leg, scale.grain)
            first = int(inside.argmax())
            if inside[first] and (entered is None or first < end):
                end, entered = max(first, 1), corner
        leg = path.unblurred(leg[:end], BLUR * scale.depth**2, self._step, scale.depth)
        return leg[1:], entered

    def _to_come(self, station: float) -> list[Corner]:
        """Return all corners except those just passed: on a contour, old ones come again."""
        passed, again = -KEEP_BEHIND * self.scale.grain, -SHORTEST_CONTOUR * self.scale.half
        return [corner for corner in self.corners if not again < corner.leave - station < passed]

    def _jump(self, cloud: np.ndarray, picture: Picture, last: np.ndarray) -> np.ndarray | None:
        """Return nodes across a gap, or None if the path ends with the view or the ridge."""
        x, y, _, tx, ty, *_ = last['row'][0].tolist()
        ahead = (x - picture.x) * tx + (y - picture.y) * ty > 0.0  # of the pad's centre
        if ahead and not picture.covers(x, y, SEEN_BORDER * self.scale.grain):
            return None
        jump = path.way_over_gap(cloud, last, self.scale)
        self.end = PathEnd.RIDGE if jump is None else PathEnd.VIEW
        return jump

    @staticmethod
    def _trimmed(nodes: np.ndarray, pieces: list[PathPart], height: float) -> np.ndarray:
        """Remove the faded tip of a ridge that ends."""
        kept = pieces[0].first
        count = path.faded(nodes[max(kept - 3 * TIP, 0):], height)
        nodes = nodes[:max(len(nodes) - count, kept)]
        while pieces and pieces[-1].first >= len(nodes):
            pieces.pop()
        return nodes

    def _find_corner(self, cloud: np.ndarray, picture: Picture, nodes: np.ndarray,
                     pieces: list[PathPart]) -> bool:
        """Search for a corner in the last leg or beyond its end; return True if one was added."""
        if not pieces:
            return False
        behind = pieces[-2].first if len(pieces) > 1 else 0
        leg = nodes[max(pieces[-1].first - FAR_TURN, behind):]
        guesses = [path.sharp_turn(leg, self.scale.depth)]
        if self.end is PathEnd.RIDGE:
            guesses.append(path.acute_turn(cloud, leg, self.scale))
        for shape in guesses:
            if shape is None or any(self._apart(shape, other) < SAME_CORNER * self.scale.grain
                                    for other in self.corners):
                continue
            fitted = fit(picture, shape)
            if fitted is None:
                continue
            corner = Corner(*fitted, self.scale.depth)
            # The zones of two corners must not overlap: the path would turn back.
            if all(self._apart(corner.shape, other) > corner.reach + other.reach
                   for other in self.corners):
                self.corners.append(corner)
                return True
        return False

    @staticmethod
    def _apart(shape: CornerShape, corner: Corner) -> float:
        return np.hypot(*(shape.vertex - corner.shape.vertex))

    def refine(self, picture: Picture, station: float) -> None:
        """Fit the corners in view to the newest image; remove those ahead without a fit."""
        for corner in list(self.corners):
            if (corner.leave < station - CORNER_BEHIND * self.scale.grain
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

    def _close(self, station: float) -> None:
        """Close the contour if the path meets its start."""
        shortest = SHORTEST_CONTOUR * self.scale.half
        if not self.may_close or station - self.began < shortest:
            return
        # Before its beginning the path was seen from one place only, and not for long enough.
        stations, unsure = self.nodes['station'], UNSURE_START * self.scale.grain
        begin = max(stations.item(0), self.began) + unsure
        k = path.closing_node(self.nodes, station, begin, CLOSING * self.scale.grain)
        if k is None:
            return
        again = (stations >= begin) & (stations < begin + BEHIND * self.scale.half)
        self.closing = float(stations[k] - unsure)  # where the pad began
        self.contour = self.nodes[:k][stations[:k] >= begin]
        self.nodes = joined([self.nodes[:k], self.nodes[again]])
        measure(self.nodes, 1)
        self.end = PathEnd.CLOSED
