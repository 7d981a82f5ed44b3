"""What the lengths of the edge map are measured by: skin depth, pitches and size of the pad."""

from functools import lru_cache
from typing import NamedTuple

from tactile_sensing.types.array import TactelArray

COARSE = 1.25  # pitches from which the tactels, and no longer the skin, limit what is told apart


class PadScale(NamedTuple):
    """
    Lengths of a pad [m]: depth of its tactels, its pitches, half of its size and longer side.

    A *grain* is the length that a picture resolves: the skin blurs an edge to a width of its
    depth, and tactels that are coarser than that sample it no finer than their pitch.
    """

    depth: float
    pitch_x: float
    pitch_y: float
    half_x: float
    half_y: float
    half: float
    grain: float

    @classmethod
    @lru_cache  # asked for with every picture
    def of(cls, array: TactelArray, depth: float) -> 'PadScale':
        """Scale of an array whose tactels lie at a depth [m]."""
        half_x, half_y = array.half_width_x, array.half_width_y
        return cls(depth, array.pitch_x, array.pitch_y, half_x, half_y, max(half_x, half_y),
                   max(depth, COARSE * max(array.pitch_x, array.pitch_y)))
