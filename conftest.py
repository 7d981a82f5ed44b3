"""For the tests of all packages: a ROS domain that no other run on this machine uses."""
import os

try:
    from tactile_common.ros.domains import hold_domain
except ImportError:  # tests of tools alone, without the workspace
    pass
else:
    if not os.environ.get('ROS_DOMAIN_ID'):
        os.environ['ROS_DOMAIN_ID'] = str(hold_domain())
