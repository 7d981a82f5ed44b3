"""A machine that has too little time: whatever is late, the pad does not press on."""
import pytest
from tactile_tests import overload


@pytest.mark.long
def test_no_force_passes_its_bound_beside_busy_loops():
    assert overload.main(['--goals', '24', '--loops', '4']) == 0
