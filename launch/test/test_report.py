"""Reports: one file, nothing from outside, for whole runs and for what went wrong."""

import base64
import dataclasses
from html.parser import HTMLParser
from itertools import pairwise
import re
import subprocess
import sys

import numpy as np
from PIL import Image, ImageSequence
import pytest
from recorded_run import TOPICS, write_bag

from edge_tracking.recording.frames_summary import summarise_recording
from edge_tracking.recording.reader import read_run
from edge_tracking.recording.summary import summarise, truth
from edge_tracking.report import animation
from edge_tracking.report.frames_page import make_recording_report
from edge_tracking.report.page import make_report, picture
from edge_tracking.report.plans import surface
from tactile_common.errors import ConfigurationError
from tactile_servo.types import State
from tactile_shape.local_surface.local_quadric import LocalQuadric
from tactile_simulation.plot import png

CAPTIONED = re.compile(r'This (run|recording): .*\d|none of its numbers is known|\d presses')
PNG = b'\x89PNG\r\n\x1a\n'


class Page(HTMLParser):
    """Collects images, texts and everything that a browser would load."""

    def __init__(self, text):
        super().__init__()
        self.images, self.links, self.words, self.captions = [], [], [], []
        self._in_caption = False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        """Take images apart from other links."""
        self._in_caption |= tag == 'figcaption'
        for name, value in attrs:
            if name in ('src', 'href'):
                (self.images if tag == 'img' else self.links).append(value)

    def handle_data(self, data):
        """Collect visible text."""
        self.words.append(data)
        if self._in_caption:
            self.captions.append(data)

    def handle_endtag(self, tag):
        """Leave a caption."""
        self._in_caption &= tag != 'figcaption'

    @property
    def text(self):
        """All text."""
        return ' '.join(self.words)


def read_page(path, pictures):
    """Return the page after checking that it needs nothing else."""
    text = path.read_text(encoding='utf-8')
    page = Page(text)
    assert not page.links and 'http' not in text and '@import' not in text
    assert len(page.images) == pictures
    for image in page.images:
        head, _, data = image.partition(',')
        assert head == 'data:image/png;base64'
        assert base64.b64decode(data).startswith(PNG)
    assert 'nan' not in page.text.split()
    assert len(page.captions) == pictures and all(CAPTIONED.search(it) for it in page.captions)
    return page


def test_report_of_a_run(run, scene, tmp_path):
    summary = summarise(run, scene, success=True)
    make_report(run, summary, scene, truth(run, scene), tmp_path / 'report.html')
    page = read_page(tmp_path / 'report.html', 5)
    assert 'Edge tracked' in page.text and 'straight' in page.text
    assert f'{1e3 * summary["lateral_rms"]:.3f} mm' in page.words
    assert '30.0 mm/s' in page.words and '400.0 Hz' in page.words


def test_a_surface_that_was_touched_is_drawn(run, scene, tmp_path):
    estimator, radius = LocalQuadric(), 0.035  # a sphere, touched along a winding path
    along = np.linspace(-0.04, 0.0, 160)
    east, north = along / radius, 2e-3 * np.sin(2.0 * np.pi * along / 16e-3) / radius
    inward = np.column_stack([-np.cos(north) * np.sin(east), -np.sin(north),
                              np.cos(north) * np.cos(east)])
    patches = [estimator.update(point, normal) for point, normal in zip(
        radius * (np.array([0.0, 0.0, 1.0]) - inward), inward, strict=True)]
    touched = dataclasses.replace(run, patches=[patch for patch in patches if patch.valid])
    assert len(touched.patches) > 50
    make_report(touched, summarise(touched, scene, success=True), scene,
                truth(touched, scene), tmp_path / 'report.html')
    assert 'Surface' in read_page(tmp_path / 'report.html', 6).text
    (tmp_path / 'surface.png').write_bytes(png(surface(touched)))


def test_report_escapes_what_comes_from_outside(run, scene, tmp_path):
    summary = summarise(run, scene, success=False, reason='<script>alert(1)</script>')
    make_report(run, summary, scene, truth(run, scene), tmp_path / 'report.html')
    assert '<script' not in (tmp_path / 'report.html').read_text(encoding='utf-8')
    assert 'Edge not tracked' in read_page(tmp_path / 'report.html', 5).text


@pytest.mark.parametrize('state', list(State))
def test_report_of_a_run_in_one_state(run, scene, tmp_path, state):
    stuck = dataclasses.replace(run, statuses=dataclasses.replace(
        run.statuses, state=np.full_like(run.statuses.state, state)))
    summary = summarise(stuck, scene, success=False)
    make_report(stuck, summary, scene, truth(stuck, scene), tmp_path / 'report.html')
    read_page(tmp_path / 'report.html', 5)


@pytest.mark.parametrize('kept', range(len(TOPICS)))
def test_reports_of_bags_with_one_topic(scene, tmp_path, kept):
    bare = read_run(write_bag(tmp_path / 'run', scene, topics=TOPICS[kept:kept + 1]).path)
    summary = summarise(bare, scene, success=False, reason='interrupted')
    make_report(bare, summary, scene, truth(bare, scene), tmp_path / 'report.html')
    read_page(tmp_path / 'report.html', 4 + len(summary['sides']))
    make_recording_report(
        bare, summarise_recording(bare), 'presses.npz', tmp_path / 'recording.html')
    assert (tmp_path / 'recording.html').stat().st_size > 1000


def test_report_of_a_recording(run, tmp_path):
    make_recording_report(run, summarise_recording(run), 'presses.npz', tmp_path / 'report.html')
    page = read_page(tmp_path / 'report.html', 3)
    assert '1 press' in page.text and 'Recording played' in page.text


def test_animation(run, scene, empty, tmp_path, monkeypatch):
    monkeypatch.setattr(animation, 'RATE', 2.0)
    path = tmp_path / 'run.gif'
    animation.animate(run, scene, path)
    with Image.open(path) as shown:
        assert shown.format == 'GIF' and shown.info['loop'] == 0
        seconds = 1e-9 * float(run.images.stamp_ns[-1] - run.images.stamp_ns[0])
        assert seconds - 1.0 < shown.n_frames / 2.0 <= seconds + 0.5
        frames = [np.asarray(frame.convert('L'), float)
                  for frame in ImageSequence.Iterator(shown)]
    middle = frames[0].shape[1] * 3 // 5  # the plan lies left of it, what is felt right
    for part in (slice(None, middle), slice(middle, None)):
        moved = [np.ptp([one[:, part], other[:, part]], axis=0).max()
                 for one, other in pairwise(frames)]
        assert max(moved) > 60.0  # grey levels: the pad moves, the pressure comes and goes
    assert path.stat().st_size < 2e6
    with pytest.raises(ConfigurationError, match='no pictures with poses'):
        animation.animate(empty, scene, path)


def test_picture_is_a_png(run, scene, tmp_path):
    picture(run, scene, truth(run, scene), tmp_path / 'path.png')
    assert (tmp_path / 'path.png').read_bytes().startswith(PNG)


def test_graph_needs_neither_matplotlib_nor_rosbags():
    code = ('import sys, edge_tracking.graph, edge_tracking.track; '
            'sys.exit(bool({"matplotlib", "rosbags.rosbag2"} & set(sys.modules)))')
    assert subprocess.run([sys.executable, '-c', code], check=False).returncode == 0
