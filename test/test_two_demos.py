"""Two demos at once, both started where one ROS domain is exported."""
import json
import os
from pathlib import Path
import subprocess

from ament_index_python.packages import get_package_prefix
from tactile_tests.graph import half_rates

DEMO = Path(get_package_prefix('edge_tracking'), 'lib/edge_tracking/demo')
DEADLINE = 240.0  # s


def test_neither_hears_the_other(tmp_path):
    environment = {**os.environ, 'ROS_DOMAIN_ID': '7'}
    demos = [subprocess.Popen(
        [DEMO, '--speed', '0.06', '--seed', str(seed), '--out', tmp_path / str(seed), '--json',
         '--parameters', half_rates(tmp_path)],
        env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        for seed in range(2)]
    try:
        said = [demo.communicate(timeout=DEADLINE) for demo in demos]
    finally:
        for demo in demos:
            demo.kill()
    domains = [errors.split('ROS_DOMAIN_ID=')[1].split()[0] for _, errors in said]
    assert domains[0] != domains[1] and '7' not in domains
    for demo, (out, errors) in zip(demos, said, strict=True):
        assert demo.returncode == 0, out + errors
        summary = json.loads(out)
        assert summary['ok'] and summary['approach_recorded'], out
        # Of the second half of the way: a machine too busy for two demos makes the entry longer.
        assert summary['lateral_steady'] < 0.3e-3, out
