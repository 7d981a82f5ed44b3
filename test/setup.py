"""Installation of the package."""
from setuptools import setup

PACKAGE = 'tactile_tests'

setup(
    name=PACKAGE,
    version='0.1.0',
    packages=[PACKAGE],
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},  # colcon test looks here for the runner
    zip_safe=True,
    maintainer='Tactile stack maintainers',
    maintainer_email='maintainers@tactile.invalid',
    description='System tests of the tactile stack: the closed loop, faults, launch files.',
    license='Apache-2.0',
)
