"""Executables of the package; their modules are imported after the signal handlers are set."""
from tactile_common.start import executable

shape_estimator = executable('tactile_shape.nodes.shape_estimator', interrupted=0)
fit = executable('tactile_shape.cli.fit')
