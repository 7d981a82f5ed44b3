"""Another package adds a protocol by an entry point."""
import os
from pathlib import Path
import subprocess
import sys

import pytest

EXAMPLE = Path(__file__).parent / 'example_protocol'
PROGRAM = """
import numpy as np
from tactile_sensing.devices.registry import protocol_named, PROTOCOLS
from tactile_sensing.nodes.driver import DriverConfig
assert PROTOCOLS[-1] == 'hex_lines' and 'flexitac' in PROTOCOLS
row = protocol_named('hex_lines')
DriverConfig(port='x', protocol='hex_lines')
decoder, device = row.decoder(2, 3), row.device()
counts = np.arange(6, dtype=np.uint8).reshape(2, 3)
decoder.receive_data(device.preamble + device.encode(counts))
print(decoder.next_frame().counts.tolist())
"""


@pytest.fixture(scope='module')
def installed(tmp_path_factory):
    """Provide the entry points and modules of the example, as if it were installed."""
    folder = tmp_path_factory.mktemp('installed')
    subprocess.run([sys.executable, 'setup.py', '-q', 'egg_info', '--egg-base', str(folder)],
                   cwd=EXAMPLE, check=True, capture_output=True)
    return [str(folder), str(EXAMPLE)]


def run(program, paths):
    return subprocess.run(
        [sys.executable, '-c', program], text=True, capture_output=True, check=False,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join([*paths, os.environ['PYTHONPATH']])})


def test_its_protocol_is_in_the_table(installed):
    done = run(PROGRAM, installed)
    assert done.stdout == '[[0, 1, 2], [3, 4, 5]]\n', done.stderr


def test_one_that_cannot_be_loaded_is_named(installed):
    program = "from tactile_sensing.devices import registry as r; r.protocol_named('hex_lines')"
    done = run(program, installed[:1])
    assert 'ConfigurationError: protocol hex_lines cannot be loaded: No module' in done.stderr
