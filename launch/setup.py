"""Installation of the package."""
from glob import glob

from setuptools import find_packages, setup

PACKAGE = 'edge_tracking'
FOLDERS = ('launch', 'config', 'scenes', 'urdf', 'rviz')

setup(
    name=PACKAGE,
    version='0.1.0',
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        *((f'share/{PACKAGE}/{folder}', files)
          for folder in FOLDERS if (files := glob(f'{folder}/*.*'))),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},
    zip_safe=True,
    maintainer='Tactile stack maintainers',
    maintainer_email='maintainers@tactile.invalid',
    description='A robot follows an edge by touch: launch files, scenes, robot and demo.',
    license='Apache-2.0',
    entry_points={'console_scripts': [
        f'{name} = {PACKAGE}.{module}:main' for name, module in (
            ('composed', 'graph'), ('demo', 'demo'), ('track', 'track'))]},
)
