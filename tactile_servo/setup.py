"""Installation of the package."""
from setuptools import find_packages, setup

try:
    from tactile_sensing.at_build import compile_kernels
except ImportError:  # not built yet: here this package is only asked for its name
    def compile_kernels(*_):
        """Compile nothing."""

PACKAGE = 'tactile_servo'


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
), f'{PACKAGE}.warm_up')
