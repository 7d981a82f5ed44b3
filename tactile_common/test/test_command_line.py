"""What all commands print."""
import json

import numpy as np

from tactile_common.command_line import to_json


def test_json_is_one_object_without_nan():
    text = to_json({'a': float('nan'), 'b': [np.float64(1.5), np.inf], 'c': np.int64(2),
                    'd': {'e': np.bool_(True)}, 'f': np.array([1.0, np.nan])})
    assert '\n' not in text
    assert json.loads(text) == {
        'a': None, 'b': [1.5, None], 'c': 2, 'd': {'e': True}, 'f': [1.0, None]}
