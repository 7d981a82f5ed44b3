"""Installation of the package."""
from setuptools import find_packages, setup

try:
    from tactile_common.at_build import compile_kernels
except ImportError:  # not built yet: here this package is only asked for its name
    def compile_kernels(*_):
        """Compile nothing."""

PACKAGE = 'tactile_simulation'


compile_kernels(setup(
    name=PACKAGE,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},
    zip_safe=True,
    maintainer='Tactile stack maintainers',
    maintainer_email='maintainers@tactile.invalid',
    description='Scenes, rendered tactile images, mock sensor and robot, closed loop.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            f'mock_robot = {PACKAGE}.nodes.mock_robot:main',
            f'mock_sensor = {PACKAGE}.nodes.mock_sensor:main',
            f'simulate = {PACKAGE}.cli.simulate:main',
        ],
    },
), f'{PACKAGE}.warm_up')
