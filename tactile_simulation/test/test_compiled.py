"""After `compile_kernels` a servo that tracks compiles nothing: in a process of its own."""

import json
import subprocess
import sys

from puma_loop import ROOT

PROGRAM = """
import gc, json, sys
from numba.core.dispatcher import Dispatcher
from tactile_servo.compile_kernels import compile_kernels
from tactile_shape.contour.contact_path import ContactPath
from tactile_simulation.closed_loop import Simulation
from tactile_simulation.scene import load_scene
from tactile_servo.types import EdgeGoal

# What the servo calls; contacts are estimated and placed by other nodes, pads simulated by none.
ContactPath.settle = lambda self: []
OURS = ('tactile_servo', 'tactile_sensing.contact.ridge')

def compiled(*modules):
    return {(f.py_func.__module__, f.py_func.__name__): [str(s) for s in f.signatures]
            for f in gc.get_objects() if isinstance(f, Dispatcher)
            and f.py_func.__module__.startswith(modules)}

compile_kernels()
before = compiled(*OURS)
simulations = [Simulation(load_scene(scene), 'trace') for scene in sys.argv[1:]]
before |= compiled('tactile_common')  # scenes use it, too
for simulation in simulations:
    simulation.run(EdgeGoal(0.1, 5.0, closed=simulation.scene.edge.closed), 20.0)
    assert simulation.servo.success, simulation.servo.reason
after = compiled('tactile_common', *OURS)
print(json.dumps({'kernels': sum(map(bool, before.values())),
                  'new': ['.'.join(name) for name in after if after[name] != before.get(name)]}))
"""


def test_a_servo_that_tracks_compiles_nothing():
    scenes = [str(ROOT / f'launch/scenes/{name}.yaml')
              for name in ('gap', 'tape_case')]
    told = subprocess.run([sys.executable, '-c', PROGRAM, *scenes], check=True,
                          capture_output=True, text=True, timeout=300)
    told = json.loads(told.stdout)
    assert told['new'] == [] and told['kernels'] > 20
