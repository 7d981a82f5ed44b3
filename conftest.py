"""For the tests of all packages: one thread, and a ROS domain that no other run here uses."""
import os

# Before numpy is loaded: threads of its matrices, one for every core of the host, wait for each
# other where others compute as well.
for _library in ('OMP', 'OPENBLAS', 'MKL'):
    os.environ.setdefault(f'{_library}_NUM_THREADS', '1')

try:
    from tactile_common.ros.domains import hold_domain
except ImportError:  # tests of tools alone, without the workspace
    pass
else:
    if not os.environ.get('ROS_DOMAIN_ID'):
        os.environ['ROS_DOMAIN_ID'] = str(hold_domain())
