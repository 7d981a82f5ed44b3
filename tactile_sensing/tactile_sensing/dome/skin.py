"""Material and mesh of the rubber of a round probe."""
from dataclasses import dataclass

from tactile_common.config import bounded, check_fields


@dataclass(frozen=True)
class SkinConfig:
    """Material of the skin, and the sizes of its finite element mesh."""

    young: float = bounded(0.3e6, "Young's modulus of the rubber", 'Pa', 1e3, 1e9)
    poisson: float = bounded(0.45, "Poisson's ratio of the rubber", '', 0.0, 0.499)
    half_angle: float = bounded(
        0.75, 'from the apex to the middle of the rim of the skin', 'rad', 0.1, 0.78)
    across: int = bounded(25, 'elements across the skin, each way', '', 3, 200)
    layers: int = bounded(4, 'elements from core to surface', '', 1, 20)
    points: int = bounded(4, 'points on each side of an element that loads can press', '', 1, 9)

    def __post_init__(self) -> None:
        check_fields(self, 'skin.')
