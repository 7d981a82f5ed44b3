"""Installation of the package; what is known of it stands in package.xml."""
from glob import glob
from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = 'edge_tracking'
FOLDERS = ('launch', 'config', 'scenes', 'scenes/surfaces', 'urdf', 'rviz')
ABOUT = ElementTree.parse('package.xml').getroot()

setup(
    name=PACKAGE,
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    package_data={PACKAGE: ['py.typed', 'web/*.css', 'web/*.html', 'web/*.js']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        *((f'share/{PACKAGE}/{folder}', files)
          for folder in FOLDERS if (files := glob(f'{folder}/*.*'))),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},  # colcon test looks here for the runner
    zip_safe=True,
    maintainer_email=ABOUT.find('maintainer').get('email'),
    **{key: ABOUT.findtext(key) for key in ('version', 'description', 'license', 'maintainer')},
    entry_points={'console_scripts': [
        f'{name} = {PACKAGE}.executables:{name}'
        for name in ('composed', 'demo', 'parameters', 'play_bag', 'record_bag', 'replay',
                     'report', 'track', 'view')]},
)
