"""Example of a package that adds a byte protocol to driver and mock sensor."""
from setuptools import setup

setup(
    name='example_protocol', version='1.0.0', py_modules=['example_protocol'],
    entry_points={'tactile_sensing.protocols': ['hex_lines = example_protocol:PROTOCOL']})
