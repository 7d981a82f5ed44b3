"""Methods of the contact estimator by name; only this module imports those of the thesis."""

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np

from tactile_sensing.types.array import TactelArray

# All but 'fit' are closed forms of the thesis; their module is loaded when one is chosen.
METHODS = ('fit', 'compensated', 'moments')


def estimate_by_thesis(frame: np.ndarray, array: TactelArray, layers: Sequence[Any], seen: Any,
                       config: Any, record: np.void) -> str:
    """Write the record of a frame by a method of the thesis, see `closed_forms.write_record`."""
    module = import_module('tactile_sensing.thesis.closed_forms')
    return module.write_record(frame, array, layers, seen, config, record)
