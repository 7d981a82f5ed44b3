"""Methods of the contact estimator by name; only this module imports those of the thesis."""

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np

from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact

# All but 'fit' are closed forms of the thesis; their module is loaded when one is chosen.
METHODS = ('fit', 'compensated', 'moments')


def estimate_by_thesis(method: str, frame: np.ndarray, array: TactelArray, layers: Sequence[Any],
                       config: Any) -> Contact:
    """Estimate the contact of a frame by a method of the thesis (`closed_forms`)."""
    module = import_module('tactile_sensing.thesis.closed_forms')
    return module.estimate_by_moments(
        frame, array, layers, method=method, model=config.model,
        averaging=config.tactel == 'area', min_snr=config.min_snr)
