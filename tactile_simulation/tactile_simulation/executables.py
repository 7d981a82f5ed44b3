"""Executables of the package; their modules are imported after the signal handlers are set."""
from tactile_common.start import executable

mock_robot = executable('tactile_simulation.nodes.mock_robot', interrupted=0)
mock_sensor = executable('tactile_simulation.nodes.mock_sensor', interrupted=0)
press_ball = executable('tactile_simulation.cli.press_ball')
simulate = executable('tactile_simulation.cli.simulate')
