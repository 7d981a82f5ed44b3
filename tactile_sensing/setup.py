"""Installation of the package."""
from glob import glob

from setuptools import find_packages, setup

try:
    from tactile_common.at_build import compile_kernels
except ImportError:  # not built yet: here this package is only asked for its name
    def compile_kernels(*_):
        """Compile nothing."""

PACKAGE = 'tactile_sensing'


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
            f'contact_estimator = {PACKAGE}.nodes.contact_estimator:main',
            f'estimate = {PACKAGE}.cli.estimate:main',
        ],
    },
), f'{PACKAGE}.compiled')
