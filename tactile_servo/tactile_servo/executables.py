"""Executables of the package; they handle signals before they import their modules."""
from tactile_common.start import executable

build_jacobian_table = executable('tactile_servo.cli.build_jacobian_table')
edge_servo = executable('tactile_servo.nodes.servo', interrupted=0)
