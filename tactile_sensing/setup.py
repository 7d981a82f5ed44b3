"""Installation of the package."""
from glob import glob
import os
import subprocess
import sys

from setuptools import find_packages, setup

PACKAGE = 'tactile_sensing'


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
            [sys.executable, '-c', f'import {PACKAGE}.compiled as c; c.warm_up()'], cwd=place,
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
        (f'share/{PACKAGE}/config', glob('config/*.yaml')),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},
    zip_safe=True,
    maintainer='Tactile stack maintainers',
    maintainer_email='maintainers@tactile.invalid',
    description='Drivers, calibration, contact estimation and a synthetic tactile array.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            f'driver = {PACKAGE}.nodes.driver:main',
            f'mock_sensor = {PACKAGE}.nodes.mock_sensor:main',
            f'contact_estimator = {PACKAGE}.nodes.contact_estimator:main',
            f'estimate = {PACKAGE}.estimate:main',
        ],
    },
))
