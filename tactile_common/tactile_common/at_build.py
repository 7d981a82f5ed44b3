"""Compiling a package's kernels while it is built; for the `setup.py` of each."""
import os
import subprocess
import sys


def compile_kernels(distribution, module):
    """
    Fill numba's cache, so that no first start waits for it; a build never fails for this.

    Parameters
    ----------
    distribution : setuptools.Distribution
        What `setup` returned; nothing is compiled unless it has installed the package.
    module : str
        Whose function `warm_up` compiles everything.
    """
    if distribution.have_run.get('develop'):  # colcon build --symlink-install
        place = os.getcwd()
    elif distribution.have_run.get('install'):
        place = os.path.abspath(distribution.get_command_obj('install').install_lib)
    else:
        return
    path = [place, *filter(None, [os.environ.get('PYTHONPATH')])]
    try:
        subprocess.run(
            [sys.executable, '-c', f'import {module} as it; it.warm_up()'], cwd=place,
            env={**os.environ, 'PYTHONPATH': os.pathsep.join(path)},
            check=False, timeout=600, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    except (OSError, subprocess.TimeoutExpired):
        pass
