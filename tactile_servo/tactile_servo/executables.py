"""Executables of the package; what they import comes once signals are taken."""
from tactile_common.start import executable

build_jacobian_table = executable('tactile_servo.cli.build_jacobian_table')
edge_servo = executable('tactile_servo.nodes.servo', interrupted=0)
