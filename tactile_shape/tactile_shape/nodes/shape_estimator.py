"""Shape estimator node: computes surface patches and a contour from contacts and sensor poses."""
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
import numpy as np
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from tactile_common.config import one_of
from tactile_common.errors import TactileError
from tactile_common.ros.cdr import DAMAGE, stamp_of, unpacked
from tactile_common.ros.conversions import pose_from_msg, set_stamp, stamp_to_ns
from tactile_common.ros.node import LATCHED, TactileNode
from tactile_common.ros.parameters import declare_from
from tactile_common.ros.runner import run
from tactile_common.state_buffer import NS
from tactile_msgs.msg import Contact as ContactMsg
from tactile_msgs.msg import SurfacePatch, TactileImage
from tactile_sensing.conversions import contact_from_msg, image_from_msg
from tactile_sensing.types.contact import Contact, ContactType
from tactile_sensing.types.image import TactileImage as Image
from tactile_shape.compile_kernels import compile_kernels
from tactile_shape.contour.contact_path import (
    ContactPath,
    MAX_GAP_NS,
    Placed,
    SpatialContact,
    WAITING,
)
from tactile_shape.conversions import contour_to_msg, model_to_markers, patch_to_msg
from tactile_shape.local_surface.local_quadric import LocalQuadric, LocalQuadricConfig
from tactile_shape.shape_estimator import ESTIMATORS, ShapeEstimator
from tactile_shape.types.patch import Patch

SOURCES = ('sensor', 'servo')
PERIOD_NS = NS  # between two contours, and two sets of markers, by the stamps of contacts
# Patches are not time-critical, so long queues avoid losses on a busy machine.
_LATE, _POSES = (QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
                 for depth in (WAITING, 3 * WAITING))


@dataclass(frozen=True)
class ShapeEstimatorConfig:
    """Method and source of the estimate."""

    method: str = one_of(
        LocalQuadric.method, "'local_quadric' (least model over a window of travel) or "
        "'surface_matrix' (the thesis' ten parameters)", ESTIMATORS)
    source: str = one_of(
        SOURCES[0], "of the contacts: 'sensor', or a 'servo' that knows better where its probe "
        'touches and publishes surface_contact', SOURCES)


class ShapeTopics:
    """
    A shape estimator between messages, inside or outside a ROS graph.

    It publishes a patch for every contact. A changed contour and markers follow once a second and
    when contact is lost. `create_publisher` is a node's method, of whose result only `publish` is
    used; `warn` takes a text.
    """

    def __init__(self, create_publisher: Callable[..., Any], warn: Callable[[str], None],
                 own: ShapeEstimatorConfig, surface: LocalQuadricConfig):
        self._warn = warn
        self._contours = create_publisher(Path, 'contour', LATCHED)
        self._markers = create_publisher(MarkerArray, 'markers', LATCHED)
        self._patches = create_publisher(SurfacePatch, 'surface_patch', 10)
        self.path, self._touched_ns = ContactPath(surface.finger_radius), 0
        self.by_servo = own.source == 'servo'
        self._surface = ESTIMATORS[own.method](surface)
        self._frame: str | None = None
        self._begin_model()

    def _begin_model(self) -> None:
        self._surface.reset()
        self._shape = ShapeEstimator(self._surface)
        self._newest: Patch | None = None
        self._published_ns: int | None = None
        self._total, self._touching, self._changed = 0, False, False

    def take_pose(self, msg: PoseStamped) -> None:
        """Process a pose of the sensor."""
        pose = self._pose(msg, 'sensor_pose')
        if pose is None:
            return
        if self._frame != msg.header.frame_id:
            if self._frame is not None:
                self._warn(f'sensor_pose is now in {msg.header.frame_id!r}, not '
                           f'{self._frame!r}: what was touched is forgotten')
                self.path.clear()
                self._begin_model()
            self._frame = msg.header.frame_id
        stamp_ns = stamp_to_ns(msg.header.stamp)
        if self.path.restarts(stamp_ns):
            self._warn('the time went back: what was touched is forgotten')
            self._begin_model()
        self._take(self.path.add_pose(stamp_ns, pose))

    def take_image(self, raw: bytes) -> None:
        """Process the bytes of an image; not needed with contacts of a servo."""
        if self.by_servo:
            return
        with suppress(*DAMAGE):
            self.path.add_picture(stamp_of(raw), lambda: _image(raw))

    def take_contact(self, stamp_ns: int, contact: Contact, sensor: str) -> None:
        """Process a contact of the named sensor with the stamp of its image [ns]."""
        if not self.by_servo or contact.type == ContactType.NONE:
            self._take(self.path.add_contact(stamp_ns, contact, (stamp_ns, sensor)))

    def take_touch(self, msg: PoseStamped) -> None:
        """Process a contact published by the servo; not needed with those of the sensor."""
        pose = self._pose(msg, 'surface_contact') if self.by_servo else None
        if pose is None or msg.header.frame_id != self._frame:  # no pose of the sensor yet
            return
        stamp_ns = stamp_to_ns(msg.header.stamp)
        anew = not 0 <= stamp_ns - self._touched_ns <= MAX_GAP_NS
        self._touched_ns = stamp_ns
        contact = SpatialContact(pose[:3, 3], -pose[:3, 2], edge=False)
        self._take([Placed((stamp_ns, ''), contact, anew, '')])

    def _pose(self, msg: PoseStamped, topic: str) -> np.ndarray | None:
        try:
            return pose_from_msg(msg.pose)
        except TactileError as error:
            self._warn(f'{topic} ignored: {error}')
            return None

    def _take(self, all_placed: list[Placed]) -> None:
        for placed in all_placed:
            patch = self._shape.take(placed)
            stamp_ns, sensor = placed.extra
            header = Header(frame_id=self._frame)
            set_stamp(header.stamp, stamp_ns)
            self._patches.publish(patch_to_msg(patch, header, sensor))
            self._publish_model(patch, placed, header)

    def _publish_model(self, patch: Patch, placed: Placed, header: Header) -> None:
        """Publish contour and markers if the patch of a contact makes them due."""
        model = self._shape.model
        if patch.valid:
            self._newest = patch
        lost = placed.contact is None and placed.anew  # its stroke has ended
        self._changed |= patch.valid or model.total != self._total or (lost and self._touching)
        self._total, self._touching = model.total, not lost
        stamp, before = stamp_to_ns(header.stamp), self._published_ns
        due = before is None or not 0 <= stamp - before < PERIOD_NS
        if self._changed and (lost or due):
            self._changed, self._published_ns = False, stamp
            self._contours.publish(contour_to_msg(model.contour, header))
            self._markers.publish(model_to_markers(model, self._newest, header))


def _image(raw: bytes) -> Image | None:
    with suppress(TactileError):
        return image_from_msg(unpacked(raw, TactileImage))
    return None


class ShapeEstimatorNode(TactileNode):
    """
    Estimates the surface at every contact and accumulates what was touched.

    Subscribes to `contact`, `sensor_pose` and `image` (for bends and ends of edges) and matches
    them by their stamps. It uses no clock, so that a replayed recording gives the same result.
    With contacts from a servo, the sensor's contacts only show when contact is lost. Publishes
    `surface_patch` for every contact, and `contour` and `markers` once a second. Parameters:
    `ShapeEstimatorConfig`, `LocalQuadricConfig`.
    """

    def __init__(self, **kwargs: Any):
        super().__init__('shape_estimator', **kwargs)
        compile_kernels()
        self._lost, self._losing = 0, False  # contacts without a pose; whether more come
        self._shape = ShapeTopics(
            self.create_publisher, self._warn, declare_from(self, ShapeEstimatorConfig),
            declare_from(self, LocalQuadricConfig))
        if self._shape.by_servo:
            self.create_subscription(
                PoseStamped, 'surface_contact', self._shape.take_touch, 10)
        else:  # subscribed before `contact`: of two waiting messages, the image comes first
            self.create_subscription(
                TactileImage, 'image', self._shape.take_image, _LATE, raw=True)
        self.create_subscription(ContactMsg, 'contact', self._on_contact, _LATE)
        self.create_subscription(PoseStamped, 'sensor_pose', self._shape.take_pose, _POSES)

    def _on_contact(self, msg: ContactMsg) -> None:
        try:
            contact = contact_from_msg(msg)
        except TactileError as error:
            self._warn(f'contact ignored: {error}')
            return
        self._shape.take_contact(stamp_to_ns(msg.header.stamp), contact, msg.sensor)

    def _on_diagnose(self) -> None:
        before, self._lost, losing = self._lost, self._shape.path.lost, self._losing
        self._losing = self._lost > before and not self.starting
        if not self._losing:
            super()._on_diagnose()
            return
        text = f'{self._lost} contacts had no sensor_pose near their stamp'
        if not losing:
            self._warn(text)
        self.diagnose(DiagnosticStatus.WARN, text)


def main(args: list[str] | None = None) -> int:
    """Run the shape estimator node."""
    return run(ShapeEstimatorNode, args)
