import os
import subprocess
import sys

from setuptools import find_packages, setup

PACKAGE = 'tactile_servo'


def compile_kernels(distribution):
    """Fill numba's cache, so that no first start waits for it; a build never fails for this."""
    if distribution.have_run.get('develop'):  # colcon build --symlink-install
        place = os.getcwd()
    elif distribution.have_run.get('install'):
        place = os.path.abspath(distribution.get_command_obj('install').install_lib)
    else:
        return
    try:
        subprocess.run(
            [sys.executable, '-c', f'import {PACKAGE}.warm_up as w; w.warm_up()'], cwd=place,
            env={**os.environ, 'PYTHONPATH': os.pathsep.join(
                [place, *filter(None, [os.environ.get('PYTHONPATH')])])},
            check=False, timeout=600, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    except (OSError, subprocess.TimeoutExpired):
        pass


compile_kernels(setup(
    name=PACKAGE,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
    ],
    install_requires=['setuptools'],
    zip_safe=True,
    maintainer='Tactile stack maintainers',
    maintainer_email='maintainers@tactile.invalid',
    description='Robot model, limits, tactile edge servo and a mock robot.',
    license='Apache-2.0',
    extras_require={'test': ['pytest']},
    entry_points={
        'console_scripts': [
            'edge_servo = tactile_servo.nodes.edge_servo:main',
            'mock_robot = tactile_servo.nodes.mock_robot:main',
            'simulate = tactile_servo.simulate:main',
        ],
    },
))
