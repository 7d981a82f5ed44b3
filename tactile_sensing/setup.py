"""Installation of the package; what is known of it stands in package.xml."""
from glob import glob
from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = 'tactile_sensing'
ABOUT = ElementTree.parse('package.xml').getroot()

setup(
    name=PACKAGE,
    packages=find_packages(exclude=['test']),
    package_data={PACKAGE: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        (f'share/{PACKAGE}/config', glob('config/*.yaml')),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},  # colcon test looks here for the runner
    zip_safe=True,
    maintainer_email=ABOUT.find('maintainer').get('email'),
    **{key: ABOUT.findtext(key) for key in ('version', 'description', 'license', 'maintainer')},
    entry_points={'console_scripts': [
        f'driver = {PACKAGE}.executables:driver',
        f'contact_estimator = {PACKAGE}.executables:contact_estimator',
        f'estimate = {PACKAGE}.executables:estimate',
        f'calibrate = {PACKAGE}.executables:calibrate',
        f'record = {PACKAGE}.executables:record',
    ]},
)
