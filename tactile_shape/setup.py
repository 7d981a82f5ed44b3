"""Installation of the package."""
from setuptools import find_packages, setup

PACKAGE = 'tactile_shape'

setup(
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
    description='Surface matrices, local curvature and object shape from contact kinematics.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            f'shape_estimator = {PACKAGE}.nodes.shape_estimator:main',
            f'fit = {PACKAGE}.cli.fit:main',
        ],
    },
)
