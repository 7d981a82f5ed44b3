"""Executables of the package; what they import comes once signals are taken."""
from tactile_common.start import executable

edge_servo = executable('tactile_servo.nodes.servo', interrupted=0)
