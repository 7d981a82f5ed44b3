from setuptools import find_packages, setup

package_name = 'tactile_servo'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
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
)
