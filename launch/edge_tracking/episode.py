"""An episode: one goal in a scene, run on the real graph, with its recording and report."""
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast, NamedTuple

from edge_tracking.goals import feedback_text, way_length
from edge_tracking.graph import add_servo, calibrate, Graph, linger, private_port
from edge_tracking.process_group import apart, Heard
from edge_tracking.recording.reader import read_run
from edge_tracking.recording.summary import summarise, truth
from edge_tracking.report.page import make_report, Shown
from edge_tracking.report.pictures import animate, picture
from edge_tracking.resources import share
from edge_tracking.track import RESUMES, TrackNode
from tactile_common.progress import live_progress
from tactile_common.ros.runner import freeze_heap, stop_on_signals
from tactile_sensing.nodes.driver import DriverConfig
from tactile_servo.laws.registry import LAWS
from tactile_servo.types import State
from tactile_shape.contour.object_model import model_of
from tactile_simulation.edge_world import EdgeScene
from tactile_simulation.world import Scene

INTERRUPTED = 'interrupted'


class Ended(NamedTuple):
    """Result of a run."""

    success: bool
    reason: str
    reason_code: int = 0


@dataclass(frozen=True)
class Episode:
    """
    One goal in a scene with mock sensor and mock robot.

    `path` is the scene's file; `speed` [m/s] and `force` [N] are the goal's. `seed` is the seed of
    the sensor's noise.
    """

    path: Path
    scene: Scene
    law: str
    speed: float
    force: float
    pattern: str = 'line'
    seed: int = 0

    def run(self, folder: Path, **common) -> Ended:
        """Track once and record into the folder's `bag`; `common` are arguments of `Graph`."""
        robot, own = share('urdf', 'puma260.urdf'), self.scene.parameters()
        with ExitStack() as stack:
            enter = stack.enter_context
            port, stop = enter(private_port()), enter(stop_on_signals())
            progress = enter(live_progress(self.scene.way or way_length(self.pattern)))
            parts = {name: enter(apart(name, *arguments, **common)) for name, arguments in (
                ('listeners', (folder / 'bag', own.shape)),
                ('mocks', (port, self.path, robot, self.seed)),
                ('sensing', (port, calibrate(port, self.scene), DriverConfig.protocol,
                             own.contact)))}
            graph = enter(Graph(**common))

            def over():
                return stop.is_set() or any(part.poll() is not None for part in parts.values())

            def show(feedback):
                progress.show(feedback.progress, State(feedback.state).name.lower(),
                              feedback_text(feedback))

            servo = add_servo(graph, robot, self.law, **own.servo)
            freeze_heap()
            heard = Heard(servo, graph.namespace)
            track = self._track(graph, heard, over, show)
            if stop.is_set():
                track.cancel()
                stop.clear()
                linger(graph, lambda: track.finished or stop.is_set(), 2.0)
                return Ended(False, INTERRUPTED)
            if not track.finished:
                return Ended(False, ', '.join(
                    f'{name} ended by itself, with status {part.returncode}'
                    for name, part in parts.items() if part.returncode is not None))
            linger(graph, stop.is_set)
        return Ended(track.success and not heard.failed,
                     '; '.join(filter(None, (track.reason, heard.failed))), track.reason_code)

    def _track(self, graph: Graph, heard: Heard, over: Callable[[], bool], show) -> TrackNode:
        """Send the goal when all nodes are connected, and wait for its end."""
        graph.spin(lambda: over() or heard.all)
        closed = self.scene.closed and LAWS[self.law].closes_contours
        track = graph.add(
            TrackNode, own={'on_feedback': show}, action=self.scene.action, speed=self.speed,
            force=self.force, resumes=RESUMES, closed=closed,
            **{'surface.pattern': self.pattern})
        graph.spin(lambda: track.finished or over())
        return track

    def report(self, folder: Path, ended: Ended, animated: bool = False) -> dict[str, Any]:
        """
        Write report.html and picture.png of a recording in a folder; return its summary.

        For a surface it also writes surface.ply. `animated` adds animation.gif, for edges only.
        Raises a TactileError if the recording cannot be read.
        """
        data = read_run(folder / 'bag')
        real = truth(data, self.scene)
        summary = summarise(data, self.scene, real, speed=self.speed, force=self.force,
                            seed=self.seed, **ended._asdict())
        make_report(folder / 'report.html', Shown(
            f'{folder.name}/bag', data, summary, self.scene, real))
        picture(data, self.scene, real, folder / 'picture.png')
        if LAWS[self.law].maps_surface:
            model_of(data.patches).save_surface(folder / 'surface.ply')
        if animated:
            animate(data, cast(EdgeScene, self.scene), folder / 'animation.gif')
        return summary
