"""A machine that has too little time: whatever is late, the pad does not press on."""
import os

import pytest
from tactile_tests import overload


@pytest.mark.skipif(not os.environ.get('TACTILE_LONG_TESTS'),
                    reason='takes minutes; runs with TACTILE_LONG_TESTS=1')
def test_no_force_passes_its_bound_beside_busy_loops():
    assert overload.main(['--goals', '24', '--loops', '4']) == 0
