"""Map of an edge: computes path, corners and ends from images and poses."""

import cmath
from collections import deque
import math

import numpy as np

from tactile_sensing.types.image import TactileImage
from tactile_servo.edge_map import path_queries
from tactile_servo.edge_map.corner import Corner
from tactile_servo.edge_map.picture import PadScale, Picture, read_picture
from tactile_servo.edge_map.records import CLOUD_POINT, joined, NODE, nodes_of
from tactile_servo.edge_map.traced_path import BEHIND, PathEnd, TracedPath
from tactile_servo.edge_map.tracing import local_line, nearest_line, on_path
from tactile_servo.reasons import Reason, ReasonCode

PICTURES = 10  # number of images whose points form the cloud
SURE_PICTURES = 3  # images with the edge elsewhere, after which the object counts as slipped
LEAST_POINTS = 3  # least number of points of a ridge in an image
PATH_SHARE = 0.4  # share of an image's ridge points on the path, above which it shows the path
OFF_PATH = 1.0  # grains from the path beyond which a ridge point is not on it
ALONE = 0.9  # least share of ridge points on the path where an edge ends and no other one begins
SLIP_CHORD = 2.0  # grains on each side of the pad: this chord is the heading after a slip
ALIGNED = 0.08  # rad between the pad's y and the path above which tactels bias directions
ROUGHLY_ALONG = 0.5  # least cosine between a heading and the ridge at which a path begins
# The angle about its normal by which a sensor is mounted otherwise than its frame says:
UNTURNED = 1.0  # grains, way that the assumption of a sensor mounted as stated counts for
STEADY = 0.15  # grains, largest change of the pad's place beside the ridge within a step
IMAGES = 1000  # largest number of images of a step, if the pad does not move
NO_RIDGE = Reason(ReasonCode.EDGE_LOST, 'no ridge in the picture')
ELSEWHERE = Reason(ReasonCode.EDGE_LOST, 'the picture shows no ridge along the path')


class EdgeMap:
    """
    Edge in a plane of the base frame, traced from images and the robot's poses at their stamps.

    The plane is that of the first image: its x and y are the sensor's, its z is the pad's normal.
    Images are transformed into the plane with the pose at their stamps, so that latency only
    delays the view ahead. The stiffness of the skin, line force per indentation [N/m^2],
    determines the height of the edge.
    """

    def __init__(self, skin_stiffness: float):
        self.skin_stiffness = skin_stiffness
        # None before the first image, or for `path` the first ridge; callers ensure this.
        self.plane: np.ndarray = None  # type: ignore[assignment]  # (4, 4), base frame -> plane
        self.picture: Picture = None  # type: ignore[assignment]  # newest image
        self.scale: PadScale = None  # type: ignore[assignment]  # lengths of its pad
        # Newest path; the path of a lost edge remains until a new one begins.
        self.path: TracedPath = None  # type: ignore[assignment]
        self.station = 0.0  # station of the pad in the newest image that shows the edge [m]
        self._cloud = np.empty(0, CLOUD_POINT)  # points of the last images
        self._counts: list[int] = []  # number of points of each image
        self.followed = False  # True while images extend the newest path
        self._off_path = 0  # number of successive images off the path
        # Share of ridge points on the path, of every image on the way to its end.
        self._end_shares: list[float] = []
        self._yaw = YawError(math.inf)  # knows nothing yet
        self._near = np.empty(0, NODE)  # nodes around the pad, extended at an open end

    def see(self, image: TactileImage, pose: np.ndarray) -> Reason | None:
        """Read an image at the sensor's pose (4, 4) in the base frame; return any problem."""
        plane = np.linalg.inv(pose) if self.plane is None else self.plane
        picture = read_picture(image, plane @ pose @ self._yaw.turn, self.skin_stiffness)
        if isinstance(picture, Reason):
            return picture
        if self.plane is None:
            self.plane = plane
            self._yaw = YawError(picture.scale.grain)
        self.picture, self.scale = picture, picture.scale
        return None

    def follow(self, direction: int, anew: bool = False) -> tuple[Reason | None, bool]:
        """
        Extend the path with the newest image.

        Returns why it does not show the edge, or None, and whether it began a new path.

        A new path begins along the sensor's y, or against it if `direction` is -1. With `anew` a
        new path begins in any case.
        """
        picture = self.picture
        if len(picture.points) < LEAST_POINTS:
            return NO_RIDGE, False
        self._remember(picture.points)
        if anew or not self.followed:
            heading = direction * picture.pose[:2, 1]
            return self._begin(heading / np.linalg.norm(heading), True)
        share, station = self._on_path(picture.points, self._near)
        if share > PATH_SHARE:
            self._off_path, self.station = 0, station
            self.path.refine(picture, station)
            self.path.extend(self._cloud, picture, self.station)
            self._see_end()
            self._take_near()
            self._see_yaw(picture)
            return None, False
        self._off_path += 1
        if self._off_path < SURE_PICTURES:
            return ELSEWHERE, False
        self._counts = []  # the object has slipped
        self._remember(picture.points)
        self.station = station
        chord = SLIP_CHORD * self.scale.grain
        return self._begin(np.array(self.way(self.station - chord, self.station + chord)), False)

    def _on_path(self, points: np.ndarray, nodes: np.ndarray) -> tuple[float, float]:
        """Return the share of ridge points near nodes, and the pad's station [m]."""
        picture, grain = self.picture, self.scale.grain
        window = path_queries.WINDOW * grain
        return on_path(points, nodes, OFF_PATH * grain, self.path.nodes, picture.x, picture.y,
                       self.station - window, self.station + window)

    def _see_end(self) -> None:
        """Compare the ridge behind the path's end with all of the path."""
        if self.path.end is not PathEnd.RIDGE:
            self._end_shares = []
        elif self.station < self.path.tip:  # beyond, a skin that creeps still shows the edge
            points, tip = self.picture.points, self.path.nodes[-2]  # the last one leads on
            behind = points[(points['place'] - tip['place']) @ tip['way'] < 0.0]
            if len(behind):
                self._end_shares.append(self._on_path(behind, self.path.nodes)[0])

    def _see_yaw(self, picture: Picture) -> None:
        """Compare the ridge under the pad with its way, not at corners or while turning."""
        grain = self.scale.grain
        left, askew, _, _ = self.at_picture(1, self.station)
        line = local_line(picture.points, picture.x, picture.y,
                          *self.way(self.station - grain, self.station + grain), grain)
        if not line.support or picture.coming > 0.0 or self.corner_at(self.station) or (
                abs(math.sin(askew)) > ALIGNED):
            self._yaw.forget()
            return
        along = complex(line.tx, line.ty) * cmath.exp(-1j * self._yaw.angle)
        self._yaw.see(complex(line.x, line.y), along, left)

    def _begin(self, heading: np.ndarray, may_close: bool) -> tuple[Reason | None, bool]:
        """Begin a path at the ridge nearest to the pad's centre."""
        picture, cloud = self.picture, self._cloud
        may_close = may_close and (self.path is None or self.path.may_close)
        self._off_path, self.followed, self._end_shares = 0, False, []
        cosine = np.abs(cloud['way'] @ heading).max()
        if cosine < ROUGHLY_ALONG:
            return Reason(ReasonCode.EDGE_LOST, (
                f'it is {np.degrees(np.arccos(cosine)):.0f} degrees off the direction of '
                "travel (at the start the pad's y), must be within 60")), False
        line = nearest_line(cloud, picture.x, picture.y, *heading, self.scale.grain)
        if not line.support:
            return ELSEWHERE, False
        start = nodes_of((line.x, line.y), line.z, (line.tx, line.ty))
        start['station'] = self.station
        self.path = TracedPath(start, cloud, picture, may_close)
        self.followed = True
        self._take_near()
        return None, True

    def _remember(self, seen: np.ndarray) -> None:
        """Add the points of an image to the cloud of the last images."""
        kept = self._counts[1 - PICTURES:]
        self._cloud = joined([self._cloud[len(self._cloud) - sum(kept):], seen], CLOUD_POINT)
        self._counts = [*kept, len(seen)]

    def _take_near(self) -> None:
        """Take the nodes around the pad; an open start or end continues straight."""
        path, reach = self.path, BEHIND * self.scale.half
        begin = path.nodes['station'].searchsorted(self.station - reach, side='right')
        near = [path.nodes[min(begin, len(path.nodes) - 1):]]
        if path.open_start and begin == 0:
            near.insert(0, _shifted(path.nodes[:1], -reach))
        if path.end is PathEnd.VIEW:
            near.append(_shifted(path.nodes[-1:], reach))
        self._near = joined(near)

    def way_in_base(self, x: float, y: float) -> list[float]:
        """Transform a direction x, y of the plane to the base frame (3,)."""
        way: list[float] = (x * self.plane[0, :3] + y * self.plane[1, :3]).tolist()
        return way

    def contour(self) -> np.ndarray | None:
        """Return the edge up to the pad, in the base frame (N, 3) [m]; None without a path."""
        path = self.path
        if path is None:
            return None
        nodes = path.contour
        if nodes is None:
            nodes = path.nodes[path.nodes['station'] <= min(self.station, path.tip)]
        back = np.linalg.inv(self.plane)
        return nodes['point'] @ back[:3, :3].T + back[:3, 3]

    @property
    def yaw_error(self) -> float:
        """Angle about its z by which the sensor seems to be turned in its mounting [rad]."""
        return self._yaw.angle

    @property
    def closed(self) -> bool:
        """True if the path has reached its start."""
        return self.path is not None and self.path.end is PathEnd.CLOSED

    @property
    def forks(self) -> bool:
        """True if another ridge begins where the path ends."""
        return sum(self._end_shares) < ALONE * len(self._end_shares)

    def locate(self, pose: np.ndarray, commanded: np.ndarray, here: float, ahead: float,
              move: tuple[float, float] = (0.0, 0.0)) -> path_queries.PathPosition:
        """
        Locate the pad on the path, for a measured and a commanded pose (4, 4) in the base frame.

        `here` and `ahead` are the stations of both poses in the last cycle [m]. The length under
        the pad is computed after a displacement `move` x, y of the commanded pose [m].
        """
        return path_queries.locate(self.path.nodes, self._near, self.plane, pose, commanded,
                                   self.scale, here, ahead, move)

    def at_picture(self, direction: int, ahead: float) -> tuple[float, float, float, float]:
        """
        Return errors of the pad in the newest image, length of the edge under it, and slope.

        The errors are lateral [m] and angular [rad], in the pad's frame; the length is in [m]. The
        slope is that of the edge around the station `ahead` [m], NaN if it is unknown.
        """
        return path_queries.at_picture(
            self.path.nodes, self._near, self.picture.pose, self.scale, direction, self.station,
            ahead, self.path.end is PathEnd.RIDGE)

    def way(self, first: float, last: float) -> tuple[float, float]:
        """Return the direction x, y between two stations [m]; beyond the end, that of its end."""
        return path_queries.direction(self.path.nodes, first, last, self.scale.grain)

    def speed_limit(self, station: float, top: float, acceleration: float, end_speed: float,
                    cut: float, settle: float) -> float:
        """Return the largest speed at a station [m/s], see `speed_profile`."""
        nodes = self.path.nodes
        seen = len(nodes) - (self.path.end is PathEnd.RIDGE)
        return path_queries.speed_profile(
            nodes[:seen], station, top, acceleration, end_speed, cut, settle)

    def corner_at(self, station: float) -> Corner | None:
        """Return the corner that replaces the edge at a station [m], or None."""
        for corner in self.path.corners:
            if corner.entry <= station <= corner.leave:
                return corner
        return None


def _shifted(node: np.ndarray, distance: float) -> np.ndarray:
    """Return a node (1,) moved by a distance in its direction [m]."""
    moved = node.copy()
    moved['place'] += distance * moved['way']
    moved['material'] = 1.0
    return moved


class YawError:
    """
    Compares the direction of the ridge in images with the way of its point under the pad.

    The robot knows the pad's centre even if the images are turned about it. Along an edge,
    straight or curved, the point under it moves in the mean direction of the ridge. `angle` [rad]
    is how much the images must be turned for that. Steps are one `grain` long, the resolution of
    an image [m]; the mean over the images of a step is compared with that of the step before.
    """

    def __init__(self, grain: float) -> None:
        self.angle, self._grain = 0.0, grain
        self._aside, self._way = 0.0, UNTURNED * grain  # sums of the steps [m]
        self.forget()

    @property
    def turn(self) -> np.ndarray:
        """Rotation (4, 4) of images about the sensor's z."""
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        return np.array([[cos, -sin, 0.0, 0.0], [sin, cos, 0.0, 0.0],
                         [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])

    def forget(self) -> None:
        """Start again with the next image, elsewhere."""
        self._last: tuple[complex, complex] | None = None  # mean place [m], direction
        self._images: deque[tuple[complex, complex, float]] = deque(maxlen=IMAGES)  # of this step

    def see(self, place: complex, direction: complex, left: float) -> None:
        """Process the ridge: place [m], direction in the image as it is, pad to the left [m]."""
        self._images.append((place, direction, left))
        if abs(place - self._images[0][0]) < self._grain:
            return
        places, directions, lefts = zip(*self._images, strict=True)
        if max(lefts) - min(lefts) > STEADY * self._grain:
            self.forget()
            return
        here, along = np.mean(places), np.mean(directions)
        if self._last is not None:
            heading = along + self._last[1]
            step = (here - self._last[0]) * heading.conjugate() / max(abs(heading), 1e-9)
            self._aside, self._way = self._aside + step.imag, self._way + step.real
            self.angle = self._aside / self._way
        self._last, self._images = (here, along), deque([self._images[-1]], IMAGES)
