"""What the stages of an estimate hand on to each other; all compiled."""

from typing import NamedTuple

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.extended_fit import EQUATIONS
from tactile_sensing.contact.gauss_newton import FIT, make_tactels, PARAMETERS, Tactels
from tactile_sensing.half_space.layers import LAYER
from tactile_sensing.types.contact import ESTIMATE

# What is known of a frame beside its load: how the load moves with the depth, and with a patch
# that hardly shows; what tactels are off beside noise, as a share of the pressure: known, found,
# and the covariance that a part too small for the weights makes; squared error over what is
# expected, at least 1; share of it that an extra would explain that was not kept; whether what
# seemed an outlier is a contact, and whether tactels are only known to be below the floor; the
# pressure that is seen over that of the load.
STATE = np.dtype([('slope', 'f8', (5,)), ('hidden', 'f8', (5,)), ('scatter', 'f8'),
                  ('found', 'f8'), ('by_gains', 'f8', (PARAMETERS, PARAMETERS)),
                  ('excess', 'f8'), ('unexplained', 'f8'), ('second', '?'), ('any_censored', '?'),
                  ('ratio', 'f8')])


class Memory(NamedTuple):
    """What the stages hand on to each other; of one frame and one model at a time."""

    stress: np.ndarray  # (layers, rows, columns): the frame, mended
    left: np.ndarray  # likewise: what the load leaves of it
    model: np.ndarray  # likewise: stress under the load
    censored: np.ndarray  # likewise: whether a tactel is only known to be below the floor
    layers: np.ndarray  # of LAYER, at the depth that was found
    tactels: Tactels
    fits: np.ndarray  # of FIT: the load; one a rung below; one with idle shear; one with faults
    equations: np.ndarray  # of EQUATIONS, shape (1,)
    state: np.ndarray  # of STATE, shape (1,)
    noise: np.ndarray  # (layers,): least that a load has left [Pa]
    top: np.ndarray  # (rows, columns): whether a reading is one of several that are highest
    # Of ESTIMATE, shape (4,): of the first model, of the second, before there is any, with `top`.
    estimates: np.ndarray


@njit(error_model='numpy')
def make_memory(layers, rows, columns, nodes):
    """Memory for frames of one shape."""
    shape = (layers, rows, columns)
    return Memory(
        np.empty(shape), np.empty(shape), np.empty(shape), np.zeros(shape, np.bool_),
        np.zeros(layers, LAYER), make_tactels(layers * rows * columns, nodes), np.zeros(4, FIT),
        np.zeros(1, EQUATIONS), np.zeros(1, STATE), np.empty(layers),
        np.zeros((rows, columns), np.bool_), np.zeros(4, ESTIMATE))
