"""Conversions between the core's data and ROS messages; bags are converted elsewhere."""
from collections.abc import Iterable
from typing import Any

from geometry_msgs.msg import Point, Pose, PoseStamped
from nav_msgs.msg import Path
import numpy as np
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from tactile_common.errors import TactileError
from tactile_common.ros.conversions import pose_from_msg, pose_to_msg
from tactile_msgs.msg import SurfacePatch
from tactile_shape.contour.object_model import ObjectModel
from tactile_shape.mesh import COLOURS, mesh_of, PATCH_SIZE
from tactile_shape.types.patch import Kind, Patch

# Limits of the part of a model that markers show, so that they stay cheap.
MAX_PATCHES, MAX_SEGMENTS = 100, 1000
_RED, _GREEN = (0.85, 0.15, 0.15), (0.15, 0.6, 0.15)
Shade = tuple[float, float, float]  # red, green, blue
_LINE_WIDTH = 5e-4  # m


def patch_to_msg(patch: Patch, header: Header, sensor: str = '') -> SurfacePatch:
    """
    Convert a patch to a SurfacePatch, with NaN for missing values.

    `header` is the header of the patch's newest contact.
    """
    message = SurfacePatch(
        header=header, sensor=sensor, kind=int(patch.kind), valid=bool(patch.valid),
        reason=patch.reason, method=patch.method, frame=pose_to_msg(patch.frame),
        extent=float(patch.extent), samples=int(patch.samples), residual=float(patch.residual))
    message.curvature = np.asarray(patch.curvature, dtype=float)
    message.curvature_seen = [bool(seen) for seen in patch.seen]
    message.curvature_covariance = np.asarray(patch.covariance, dtype=float).reshape(-1)
    message.surface_matrix = patch.surface_matrix.reshape(-1)
    return message


def patch_from_msg(message: Any) -> Patch:
    """Convert a SurfacePatch to a patch; TactileError if kind or required pose is invalid."""
    if message.kind not in list(Kind):
        raise TactileError(f'kind of patch is {message.kind}, must be at most {max(Kind)}')
    known = np.isfinite(message.frame.position.x)
    return Patch(
        Kind(message.kind), message.valid, message.reason, message.method,
        pose_from_msg(message.frame) if known or message.valid else np.full((4, 4), np.nan),
        np.array(message.curvature), np.array(message.curvature_seen),
        np.array(message.curvature_covariance).reshape(2, 2), message.extent, message.samples,
        message.residual, np.array(message.surface_matrix).reshape(4, 4))


def contour_to_msg(points: np.ndarray, header: Header) -> Path:
    """Convert a contour (N, 3) [m] to a Path; its orientations have no meaning."""
    return Path(header=header, poses=[
        PoseStamped(header=header, pose=Pose(position=_point(point)))
        for point in points.tolist()])


def model_to_markers(model: ObjectModel, patch: Patch | None, header: Header) -> MarkerArray:
    """
    Return markers: newest valid patch with principal directions, the surface, the contour.

    Those that are empty delete what was shown before.
    """
    newest = [] if patch is None else [patch]
    markers = [_mesh(list(model.patches)[-MAX_PATCHES:], header, 'surface'),
               _lines(model.strokes, header), _mesh(newest, header, 'patch'),
               _directions(newest, header)]
    for marker in markers:
        if not marker.points:
            marker.action = Marker.DELETE
    return MarkerArray(markers=markers)


def _mesh(patches: list[Patch], header: Header, namespace: str) -> Marker:
    marker = _marker(header, namespace, Marker.TRIANGLE_LIST, 1.0)
    vertices, colours, faces = mesh_of(patches)
    corners = faces.reshape(-1)
    marker.points = [_point(vertex) for vertex in vertices[corners].tolist()]
    shades: dict[Shade, ColorRGBA] = {}  # one message per colour, shared by all vertices
    marker.colors = [shades.setdefault(shade, _colour(shade)) for shade in
                     map(tuple, colours[corners].tolist())]
    return marker


def _lines(strokes: list[list[np.ndarray]], header: Header) -> Marker:
    marker = _marker(header, 'contour', Marker.LINE_LIST, _LINE_WIDTH)
    pairs = [pair for stroke in strokes for pair in zip(stroke, stroke[1:], strict=False)]
    marker.points = [_point(point.tolist()) for pair in pairs[-MAX_SEGMENTS:] for point in pair]
    return marker


def _directions(patches: list[Patch], header: Header) -> Marker:
    marker = _marker(header, 'principal directions', Marker.LINE_LIST, _LINE_WIDTH)
    for patch in patches:
        for axis, shade, seen in zip(patch.directions, (_RED, _GREEN), patch.seen, strict=True):
            if seen:
                for end in (-0.5 * PATCH_SIZE, 0.5 * PATCH_SIZE):
                    marker.points.append(_point((patch.origin + end * axis).tolist()))
                    marker.colors.append(_colour(shade, 1.0))
    return marker


def _marker(header: Header, namespace: str, kind: int, scale: float) -> Marker:
    marker = Marker(header=header, ns=namespace, type=kind, action=Marker.ADD,
                    color=_colour(COLOURS[Kind.NONE], 1.0))
    marker.pose.orientation.w = 1.0
    marker.scale.x = marker.scale.y = marker.scale.z = scale
    return marker


def _colour(shade: Shade, alpha: float = 0.6) -> ColorRGBA:
    red, green, blue = shade
    return ColorRGBA(r=red, g=green, b=blue, a=alpha)


def _point(values: Iterable[float]) -> Point:
    x, y, z = values
    return Point(x=x, y=y, z=z)
