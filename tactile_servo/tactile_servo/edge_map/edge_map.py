"""Map of an edge: pictures and poses in; path, corners and ends out."""

from typing import NamedTuple

import numpy as np

from tactile_sensing.types.image import TactileImage
from tactile_servo.edge_map import path_queries
from tactile_servo.edge_map.corner import Corner
from tactile_servo.edge_map.path import nodes_from
from tactile_servo.edge_map.picture import PadScale, Picture, read_picture
from tactile_servo.edge_map.records import CLOUD_POINT, joined, nodes_of, retyped
from tactile_servo.edge_map.traced_path import BEHIND, PathEnd, TracedPath
from tactile_servo.edge_map.tracing import local_line, on_path
from tactile_servo.reasons import Reason, ReasonCode

PICTURES = 10  # whose points make the cloud
SURE_PICTURES = 3  # that show the edge elsewhere before it is believed to have slipped
NO_RIDGE = Reason(ReasonCode.EDGE_LOST, 'no ridge in the picture')
ELSEWHERE = Reason(ReasonCode.EDGE_LOST, 'the picture shows no ridge along the path')


class Sight(NamedTuple):
    """What became of a picture: why it does not show the edge; whether a path began with it."""

    problem: Reason | None
    begun: bool = False


class Stand(NamedTuple):
    """Where a pad stands on the path, measured and commanded."""

    there: np.ndarray  # (4, 4), pose of the commanded pad in the plane
    here: float  # station of the measured pad [m],
    aside: tuple[float, float]  # way x, y from it to the path [m],
    along: tuple[float, float]  # and direction x, y of the path there
    ahead: float  # station of the commanded pad [m],
    way: tuple[float, float]  # direction of the path around it,
    length: float  # and of the edge under the pad after a move [m]


class EdgeMap:
    """
    Edge in a plane of the base frame, traced where the robot was when pictures were taken.

    The plane is that of the first picture: its x and y are the sensor's, its z the pad's
    normal. Pictures are put into it by the pose at their stamps, so that latency only ages
    what is seen ahead. The stiffness of the skin, line force per length and indentation [N/m^2],
    tells the height of the edge.
    """

    def __init__(self, skin_stiffness: float):
        self.skin_stiffness = skin_stiffness
        # None until there was a picture, and a ridge in it: whoever asks for more knows that.
        self.plane: np.ndarray = None  # type: ignore[assignment]  # (4, 4), base frame -> plane
        self.picture: Picture = None  # type: ignore[assignment]  # the newest one,
        self.scale: PadScale = None  # type: ignore[assignment]  # lengths of its pad
        # The newest one; that of an edge that was lost stays until another begins.
        self.path: TracedPath = None  # type: ignore[assignment]
        self.station = 0.0  # of the pad on the path at the newest picture that shows it [m]
        self._axes: list[list[float]] = []  # of the plane, x and y, in the base frame
        self._cloud = np.empty(0, CLOUD_POINT)  # of the last pictures,
        self._counts: list[int] = []  # so many points of each
        self.followed = False  # whether the newest path is one that pictures still extend
        self._off_path = 0
        self._near: np.ndarray | None = None  # nodes around the pad, an open end led on

    def see(self, image: TactileImage, pose: np.ndarray) -> Reason | None:
        """Take an image and the pose (4, 4) of the sensor in the base frame at its stamp."""
        plane = np.linalg.inv(pose) if self.plane is None else self.plane
        picture = read_picture(image, plane @ pose, self.skin_stiffness)
        if isinstance(picture, Reason):
            return picture
        if self.plane is None:
            self.plane, self._axes = plane, plane[:2, :3].tolist()
        self.picture, self.scale = picture, picture.scale
        return None

    def follow(self, direction: int, anew: bool = False) -> Sight:
        """
        Extend the path by what the newest picture shows.

        A path begins along the sensor's y, or against it where `direction` is -1; with `anew`
        whatever is known.
        """
        picture = self.picture
        if len(picture.points) < 3:
            return Sight(NO_RIDGE)
        self._remember(picture.points)
        if anew or not self.followed:
            heading = direction * picture.pose[:2, 1]
            return self._begin(heading / np.linalg.norm(heading), True)
        window = path_queries.WINDOW * self.scale.grain
        share, station = on_path(
            self._cloud[-len(picture.points):], self._near, self.scale.grain,
            self.path.nodes, picture.x, picture.y, self.station - window, self.station + window)
        if share > 0.4:  # of its points are on the path, or it shows something else
            self._off_path, self.station = 0, station
            self.path.refine(picture, station)
            self.path.extend(self._cloud, picture, self.station)
            self._take_near()
            return Sight(None)
        self._off_path += 1
        if self._off_path < SURE_PICTURES:
            return Sight(ELSEWHERE)
        self._counts = []  # the object has slipped
        self._remember(picture.points)
        self.station = station
        chord = 2.0 * self.scale.grain
        return self._begin(np.array(self.way(self.station - chord, self.station + chord)), False)

    def _begin(self, heading: np.ndarray, may_close: bool) -> Sight:
        """Begin a path at the point of the ridge that is nearest to the pad's centre."""
        picture, cloud = self.picture, self._cloud
        may_close = may_close and (self.path is None or self.path.may_close)
        self._off_path, self.followed = 0, False
        along = np.abs(cloud['way'] @ heading) > 0.5
        if not along.any():
            return Sight(ELSEWHERE)
        place = cloud['place'][along]
        nearest = place[np.linalg.norm(place - picture.place, axis=1).argmin()]
        line = local_line(cloud, *nearest, *heading, self.scale.grain)
        if not line.found:
            return Sight(ELSEWHERE)
        start = nodes_of((line.x, line.y), line.z, (line.tx, line.ty))
        start['station'] = self.station
        self.path = TracedPath(start, cloud, picture, may_close)
        self.followed = True
        self._take_near()
        return Sight(None, True)

    def _remember(self, seen: np.ndarray) -> None:
        """Put the points of a picture to those of the last ones."""
        kept = self._counts[1 - PICTURES:]
        self._cloud = joined([self._cloud[len(self._cloud) - sum(kept):], seen], CLOUD_POINT)
        self._counts = [*kept, len(seen)]

    def _take_near(self) -> None:
        path, behind = self.path, BEHIND * self.scale.half
        self._near = retyped(nodes_from(path.nodes, self.station - behind, behind,
                                        path.open_start, path.end is PathEnd.VIEW))

    def way_in_base(self, x: float, y: float) -> tuple[float, float, float]:
        """Direction x, y of the plane in the base frame."""
        (ax, ay, az), (bx, by, bz) = self._axes
        return x * ax + y * bx, x * ay + y * by, x * az + y * bz

    def contour(self) -> np.ndarray | None:
        """Edge as far as the pad has come, in the base frame (N, 3) [m]; None without a path."""
        path = self.path
        if path is None:
            return None
        nodes = path.contour
        if nodes is None:
            nodes = path.nodes[path.nodes['station'] <= min(self.station, path.tip)]
        back = np.linalg.inv(self.plane)
        return nodes['point'] @ back[:3, :3].T + back[:3, 3]

    @property
    def closed(self) -> bool:
        """Whether the path has met its start."""
        return self.path is not None and self.path.end is PathEnd.CLOSED

    def stand(self, pose: np.ndarray, commanded: np.ndarray, here: float, ahead: float,
              move: tuple[float, float] = (0.0, 0.0)) -> Stand:
        """
        Where the pad stands at a measured and a commanded pose (4, 4) of the base frame.

        `here` and `ahead` are the stations of both in the last cycle [m]; `move` is the way x, y
        from the commanded one, at the end of which the length under the pad is wanted [m].
        """
        scale, there = self.scale, np.empty((4, 4))
        return Stand(there, *path_queries.stand(
            self.path.nodes, self._near, self.plane, pose, commanded, scale.half_x, scale.half_y,
            scale.grain, here, ahead, move, there))

    def at_picture(self, direction: int, ahead: float) -> tuple[float, float, float, float]:
        """
        Errors of the pad at the newest picture, lateral [m] and angle [rad] in its own frame.

        With them the length of the edge under the pad [m], and the edge's rise along itself around
        a station ahead [m], NaN where that is not known.
        """
        scale = self.scale
        return path_queries.at_picture(
            self.path.nodes, self._near, self.picture.pose, scale.half_x, scale.half_y,
            scale.grain, direction, self.station, ahead, self.path.end is PathEnd.RIDGE)

    def way(self, first: float, last: float) -> tuple[float, float]:
        """Direction x, y of the path between two stations [m], beyond its end straight on."""
        return path_queries.direction(self.path.nodes, first, last, self.scale.grain)

    def speed_limit(self, station: float, top: float, acceleration: float, end_speed: float,
                    cut: float, settle: float) -> float:
        """Largest speed at a station [m/s]; see `speed_profile`."""
        nodes = self.path.nodes
        seen = len(nodes) - (self.path.end is PathEnd.RIDGE)
        return path_queries.speed_profile(
            nodes[:seen], station, top, acceleration, end_speed, cut, settle)

    def corner_at(self, station: float) -> Corner | None:
        """Corner that stands for the edge at a station [m]."""
        for corner in self.path.corners:
            if corner.entry <= station <= corner.leave:
                return corner
        return None
