"""User settings of probe, robot and task for the laws that follow a surface."""
from dataclasses import dataclass, field

from tactile_common.config import bounded
from tactile_common.errors import ConfigurationError


@dataclass(frozen=True)
class ProbeConfig:
    """Geometry and stiffness of the round probe."""

    skin_radius: float = bounded(0.027, 'of the surface of the skin', 'm', 1e-3, 1.0)
    array_radius: float = bounded(0.025, 'of the sphere of the tactels', 'm', 1e-3, 1.0)
    stiffness: float = bounded(
        15600.0, 'K_z of (6.7): force per way along the normal of skin, finger and robot, at '
        '5 N; it grows with the root of the force', 'N/m', 10.0, 1e7)
    modulus: float = bounded(
        1.44e8, "pressure per indentation of the skin's surface: P / (pi R d^2) where a force P "
        'presses a plate in by d', 'Pa/m', 1e3, 1e13)

    def __post_init__(self) -> None:
        if not self.array_radius < self.skin_radius:
            raise ConfigurationError(
                f'probe.array_radius: {self.array_radius} m is not below probe.skin_radius, '
                f'{self.skin_radius} m')


@dataclass(frozen=True)
class JacobianConfig:
    """Source of the Jacobian."""

    table: str = field(default='', metadata={
        'doc': 'file made by build_jacobian_table, whose nearest entry is taken; empty: the '
               "Jacobian at the pad's centre, of a half-space on the probe's tangent plane"})


@dataclass(frozen=True)
class CourseConfig:
    """Motion over the surface."""

    acceleration: float = bounded(0.2, 'acceleration of the contact', 'm/s^2', 0.01, 100.0)
    blind: float = bounded(
        1e-5, 'error of the predicted depth that is accepted until the next image: the probe is '
        'slower where the curvature ahead is less certain', 'm', 1e-7, 1e-2)


@dataclass(frozen=True)
class PressConfig:
    """Motion along the contact's normal."""

    gain: float = bounded(
        30.0, 'rate at which an error of the force is made up', '1/s', 0.1, 500.0, live=True)


@dataclass(frozen=True)
class RollConfig:
    """Rotation of the probe about its centre."""

    max_rate: float = bounded(4.0, 'largest rate of turn', 'rad/s', 1e-3, 50.0)
    acceleration: float = bounded(
        6.0, 'acceleration of the turn; a wrist that is asked for more than it can holds back '
        'the whole probe, out of the surface', 'rad/s^2', 0.1, 1e4)


@dataclass(frozen=True)
class SurfaceConfig:
    """User settings of probe, robot and task for the laws that follow a surface."""

    probe: ProbeConfig = field(default_factory=ProbeConfig)
    jacobian: JacobianConfig = field(default_factory=JacobianConfig)
    course: CourseConfig = field(default_factory=CourseConfig)
    press: PressConfig = field(default_factory=PressConfig)
    roll: RollConfig = field(default_factory=RollConfig)
