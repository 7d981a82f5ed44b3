"""
The mock sensor and the mock robot in a process of their own.

The real ones take nothing of the interpreter that runs driver, estimators and servo; neither
should these where the rates of the graph matter.
"""

from contextlib import contextmanager
import json
import signal
import subprocess
import sys
import threading

from edge_tracking.composed import add_mocks, Graph

PATIENCE = 5.0  # s for the process to end by itself


@contextmanager
def mocks_apart(port, scene, robot, seed=0, *, domain=None, namespace='tactile'):
    """
    Run the mocks while in a `with` statement, see `composed.add_mocks`.

    Parameters
    ----------
    port, scene, robot : str or Path
        Of the pseudo-terminal's link, the scene's file and the URDF.
    seed : int
        Of the sensor's noise.
    domain : int, optional
        ROS domain; that of the environment if missing.
    namespace : str
        Of the sensor.

    Yields
    ------
    subprocess.Popen
        The process; it ends with this one, however this one ends.
    """
    options = {'mocks': [str(port), str(scene), str(robot), seed],
               'graph': {'domain': domain, 'namespace': namespace}}
    process = subprocess.Popen([sys.executable, '-m', __name__, json.dumps(options)],
                               stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.stdin.close()
        try:
            process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def main():
    """Run the mocks until the standard input ends."""
    options = json.loads(sys.argv[1])
    for number in (signal.SIGINT, signal.SIGTERM):  # meant for the graph, which ends this as well
        signal.signal(number, signal.SIG_IGN)
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    with Graph(**options['graph']) as graph:
        add_mocks(graph, *options['mocks'])
        graph.spin(ended.is_set)
    return 0


if __name__ == '__main__':
    sys.exit(main())
