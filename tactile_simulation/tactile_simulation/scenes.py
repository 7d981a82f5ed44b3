"""Scenes of every kind, and what a sensor sees in them."""
from pathlib import Path
from typing import Any, NamedTuple

from tactile_simulation.renderer import EdgeRenderer
from tactile_simulation.scene import edge_scene, parsed, Scene
from tactile_simulation.scene_surface import surface_scene, SurfaceScene
from tactile_simulation.surface_renderer import SurfaceRenderer


def load_any_scene(path: str | Path) -> Scene | SurfaceScene:
    """Read a scene of an edge or of a surface, see `load_scene`."""
    def make(tree):
        if isinstance(tree, dict) and 'surface' in tree:
            return surface_scene(tree, Path(path))
        return edge_scene(tree, Path(path))
    return parsed(path, make)


def renderer_of(scene: Scene | SurfaceScene) -> EdgeRenderer:
    """Return what renders a scene for its sensor."""
    if isinstance(scene, SurfaceScene):
        return SurfaceRenderer(scene, scene.sensor.array)
    return EdgeRenderer(scene, scene.sensor.array)


class NodeParameters(NamedTuple):
    """Parameters that what touches asks for, beside those of a file."""

    servo: dict[str, Any]
    shape: dict[str, Any]  # of the shape estimator,
    contact: dict[str, Any]  # and of the contact estimator


def parameters_for(scene: Scene | SurfaceScene | None) -> NodeParameters:
    """Parameters for a scene's probe; none for a flat pad, or without a scene."""
    if not isinstance(scene, SurfaceScene):
        return NodeParameters({}, {}, {})
    dome = scene.dome
    return NodeParameters(
        {'probe.skin_radius': dome.skin_radius, 'probe.array_radius': dome.array_radius},
        {'source': 'servo'},
        {'method': 'moments'})  # no model of a flat pad fits, and to try them all takes long
