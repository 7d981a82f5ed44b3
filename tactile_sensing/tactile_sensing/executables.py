"""Executables of the package; their modules are imported after signal handlers are set."""
from tactile_common.start import executable

driver = executable('tactile_sensing.nodes.driver', interrupted=0)
contact_estimator = executable('tactile_sensing.nodes.contact_estimator', interrupted=0)
estimate = executable('tactile_sensing.cli.estimate')
calibrate = executable('tactile_sensing.cli.calibrate')
record = executable('tactile_sensing.cli.record')
