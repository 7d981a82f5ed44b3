"""Executables of the package; what they import comes once signals are taken."""
from tactile_common.start import executable

shape_estimator = executable('tactile_shape.nodes.shape_estimator', interrupted=0)
fit = executable('tactile_shape.cli.fit')
