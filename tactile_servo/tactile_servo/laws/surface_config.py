"""User settings of probe, robot and task for the laws that follow a surface."""
from dataclasses import dataclass, field
import math

from tactile_common.config import bounded, check_fields, documented


@dataclass(frozen=True)
class ProbeConfig:
    """Geometry and skin of the round probe; the depth of its tactels is in the calibration."""

    skin_radius: float = bounded(0.027, 'of the surface of the skin', 'm', 1e-3, 1.0)
    modulus: float = bounded(
        1.44e8, "pressure per indentation of the skin's surface: P / (pi R d^2) where a force P "
        'presses a plate in by d', 'Pa/m', 1e3, 1e13)

    def __post_init__(self) -> None:
        check_fields(self)

    def stiffness(self, force: float) -> float:
        """Return K_z of (6.7), the change of the force P(d) per d, at a force [N]."""
        return 2.0 * math.sqrt(math.pi * self.skin_radius * self.modulus * force)


@dataclass(frozen=True)
class SurfaceConfig:
    """User settings of probe, robot and task for the laws that follow a surface."""

    probe: ProbeConfig = field(default_factory=ProbeConfig)
    table: str = documented(
        '', 'file made by build_jacobian_table, whose nearest entry is taken; empty: the '
        "Jacobian at the pad's centre, of a half-space on the probe's tangent plane",
        name='jacobian.table')
    acceleration: float = bounded(
        0.2, 'acceleration of the contact', 'm/s^2', 0.01, 100.0, name='speed.acceleration')
    blind: float = bounded(
        1e-5, 'error of the predicted depth that is accepted until the next image: the probe is '
        'slower where the curvature ahead is less certain', 'm', 1e-7, 1e-2, name='speed.blind')
    force_gain: float = bounded(
        30.0, 'rate at which an error of the force is made up', '1/s', 0.1, 500.0, live=True,
        name='force.gain')

    def __post_init__(self) -> None:
        check_fields(self)
