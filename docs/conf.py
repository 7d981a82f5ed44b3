"""Sphinx configuration of the documentation site, built by `./ws docs`."""
from pathlib import Path
from xml.etree import ElementTree

project = 'Touch-driven robot control'
release = ElementTree.parse(
    Path(__file__).resolve().parents[1] / 'launch/package.xml').getroot().findtext('version')
author = copyright = 'Tactile stack maintainers'
extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon']
autodoc_member_order = 'bysource'
autodoc_preserve_defaults = True
napoleon_use_rtype = False
myst_heading_anchors = 4
suppress_warnings = [
    'misc.highlighting_failure',  # `sh` with placeholders
    'ref.python']  # `shape` in a numpydoc type is not a link
html_theme = 'furo'
html_title = project
html_static_path = ['static']
html_css_files = ['wide.css']
html_show_sourcelink = False
