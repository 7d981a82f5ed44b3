"""Reports: one file, nothing from outside, for whole runs and for what went wrong."""

import base64
import dataclasses
import hashlib
from html.parser import HTMLParser
import json
import shutil
import subprocess
import sys

import numpy as np
import pytest
from recorded_run import TOPICS, with_columns, write_bag

from edge_tracking.recording import run as run_module
from edge_tracking.recording.run import read_run
from edge_tracking.recording.summary import Shown, summarise, summarise_recording, truth
from edge_tracking.report import charts
from edge_tracking.report.page import main, make_report
from tactile_servo.robot_config import NodeConfig
from tactile_servo.types import State
from tactile_shape.local_surface.local_quadric import LocalQuadric

HOSTILE = '</script><script>alert(1)</script><img src=x onerror=alert(2)>'


class Page(HTMLParser):
    """Collects elements, images, texts, scripts and everything that a browser would load."""

    def __init__(self, text):
        super().__init__()
        self.images, self.links, self.words, self.captions, self.tags = [], [], [], [], []
        self.handlers, self.policy, self.scripts, self.styles = [], '', [], []
        self.classes, self.data = [], {'chart': [], 'run': []}
        self._inside = None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self._inside, known = tag, dict(attrs)
        self.tags.append(tag)
        self.classes.append(known.get('class'))
        if known.get('http-equiv') == 'Content-Security-Policy':
            self.policy = known['content']
        for name in ('chart', 'run'):
            if f'data-{name}' in known:
                self.data[name].append(json.loads(known[f'data-{name}']))
        for name, value in attrs:
            if name in ('src', 'href'):
                (self.images if tag == 'img' else self.links).append(value)
            if name.startswith('on') or name == 'style':
                self.handlers.append((tag, name))

    def handle_data(self, data):
        kinds = {'script': self.scripts, 'style': self.styles}
        if self._inside in kinds:
            kinds[self._inside].append(data)
        else:
            self.words.append(data)
            if 'figcaption' in self.tags[-3:]:
                self.captions.append(data)

    def handle_endtag(self, tag):
        self._inside = None
        if tag == 'figcaption':
            self.tags.append('/figcaption')

    @property
    def text(self):
        return ' '.join(self.words)


def read_page(path, charts=None):
    """Return the page after checking that it needs nothing else, and runs nothing else."""
    text = path.read_text(encoding='utf-8')
    page = Page(text)
    assert not page.links and '://' not in text and '@import' not in text
    assert not page.handlers and len(page.scripts) == 3 and len(page.styles) == 1
    assert page.policy.startswith("default-src 'none'; ") and 'unsafe' not in page.policy
    for inner in (*page.scripts, *page.styles):
        digest = base64.b64encode(hashlib.sha256(inner.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in page.policy
    assert not page.images and page.classes.count('chart') == len(page.data['chart'])
    assert charts is None or len(page.data['chart']) == charts
    assert 'nan' not in page.text.split()
    assert any(it.strip() for it in page.captions)
    return page


def report(path, run, summary, scene=None, real=None):
    make_report(path, Shown('runs/bag', run, summary, scene, real))
    return path


def test_report_of_a_run(run, scene, tmp_path):
    summary = summarise(run, scene)
    page = read_page(report(tmp_path / 'report.html', run, summary, scene, truth(run, scene)), 6)
    assert 'Edge tracked' in page.text and 'straight' in page.text and 'simulated' in page.words
    assert f'{1e3 * summary["lateral_rms"]:.3f} mm' in page.words
    assert '30.0 mm/s' in page.words and '400.0 Hz' in page.words


def unpacked(text, kind):
    return np.frombuffer(base64.b64decode(text), kind)


def test_player_shows_what_was_recorded(run, scene, tmp_path):
    page = read_page(report(tmp_path / 'report.html', run, summarise(run, scene)))
    it, = page.data['run']
    time, images = unpacked(it['time'], '<f4'), run.images
    levels = unpacked(it['levels'], 'u1').reshape(len(time), 16, 16)
    assert f'{len(time)} of {len(images.stamp_ns)} images' in page.text
    assert len(time) == pytest.approx(60.0 * (time[-1] - time[0]), abs=2)
    seconds = run.seconds(images.stamp_ns)
    shown = np.abs(seconds[:, None] - time).argmin(axis=0)
    np.testing.assert_allclose(time, seconds[shown], atol=1e-6)
    off = np.abs(it['top'] / 254 * levels - np.maximum(images.frames[shown], 0.0))
    assert off.max() <= 0.501 / 254 * it['top']  # half a level
    x, _, yaw = unpacked(it['contact'], '<f4').reshape(-1, 3).T
    contact = np.searchsorted(run.contacts.stamp_ns, images.stamp_ns[shown])
    np.testing.assert_allclose(x, np.where(
        run.contacts.valid[contact], run.contacts.x[contact], x), atol=1e-8)
    assert np.isfinite(yaw).sum() > 100
    stage = unpacked(it['stage'], '<i4')
    assert [it['stages'][k] for k in (stage[5], stage[len(stage) // 2], stage[-1])] == [
        ['approach', 'goal accepted'], ['track', 'contact'], ['done', 'the edge ended']]


def test_charts_show_what_was_measured(run, scene, tmp_path):
    real = truth(run, scene)
    page = read_page(report(tmp_path / 'report.html', run, summarise(run, scene),
                            scene, real))
    known = {it['title']: it for it in page.data['chart']}
    felt, true = known['Force on the pad']['series']
    np.testing.assert_allclose(unpacked(true['x'], '<f4'), real.time, atol=1e-6)
    np.testing.assert_allclose(unpacked(true['y'], '<f4'), real.force, atol=1e-5)
    assert np.nanmax(unpacked(felt['y'], '<f4')) == pytest.approx(5.0, abs=0.1)
    assert known['Force on the pad']['marks'][-1][1] == 5.0
    measured = known["What is followed, from the pad's centre"]
    x = unpacked(measured['series'][0]['y'], '<f4')
    assert np.nanmax(np.abs(x)) == pytest.approx(3.0, abs=0.05)  # mm beside the edge at contact
    assert [colour for *_, colour in measured['bands']] == [
        charts.SHADES[State.APPROACH], charts.SHADES[State.RETREAT]]


def test_no_peak_of_a_long_line_is_lost():
    x, y = np.arange(100_001.0), np.zeros(100_001)
    y[[777, 100_000]], y[5000], y[50_000:51_000] = (3.0, 2.0), -4.0, np.nan
    shown, values = charts.extremes(x, y)
    assert len(shown) <= charts.MOST_POINTS + 2 and (np.diff(shown) >= 0.0).all()
    peaks = {(at, value) for at, value in zip(shown, values, strict=True) if value}
    assert {(777.0, 3.0), (100_000.0, 2.0), (5000.0, -4.0)} <= peaks
    assert np.isnan(values).any()


def test_a_long_run_is_thinned_and_says_so(run, scene, tmp_path):
    count = 600_000  # ten minutes at 1 kHz
    stamps = run.start_ns + 1_000_000 * np.arange(count)
    frames = np.broadcast_to(run.images.frames[400], (count, 16, 16))
    long = dataclasses.replace(run, images=dataclasses.replace(
        run.images, frames=frames, stamp_ns=stamps, sequence=np.arange(count)),
        stamps={**run.stamps, 'image': stamps})
    path = report(tmp_path / 'report.html', long, summarise(run))
    shown = charts.MAX_BYTES // (256 + 36)
    assert f'{shown} of 600000 images, evenly chosen' in read_page(path).text
    assert path.stat().st_size < 5e6


def test_two_recordings_stand_side_by_side(bag, tmp_path):
    path = tmp_path / 'report.html'
    write_bag(tmp_path / 'touch', topics=TOPICS[:3])
    assert main([str(bag), str(tmp_path / 'touch'), '-o', str(path)]) == 0
    page = read_page(path)
    assert len(page.data['run']) == 2 and page.text.count('Recording \u201c') == 4
    assert 'Not recorded.' in page.text  # the states of what had no servo


def test_command_says_what_a_bag_holds(bag, tmp_path, capsys):
    path = tmp_path / 'report.html'
    assert main([str(bag), '-o', str(path), '--json']) == 0
    summary, page = json.loads(capsys.readouterr().out), read_page(path)
    assert 'lateral_rms' not in summary  # nobody knows the true edge
    assert 'robot' in page.words and '2023-11-14 22:13:20 UTC' in page.words
    assert f'{1e3 * summary["tracked_length"]:.1f} mm' in page.words
    assert {'approach', 'track', 'retreat', 'the edge ended'} <= {*page.words}
    assert main([str(bag), '-o', str(path), '--scene', 'straight']) == 0
    assert 'Of the true edge' in read_page(path).text


@pytest.mark.parametrize('spoil, text', [
    (lambda path: path / 'none', 'there is no such bag'),
    (lambda path: write_bag(path, topics=TOPICS[8:9]), 'holds neither images'),
    (lambda path: cut(write_bag(path, topics=TOPICS[:2])), 'ends at byte'),
    (lambda path: foreign(path), 'is not a rosbag2 recording')])
def test_what_cannot_be_read_overwrites_nothing(spoil, text, tmp_path, capsys):
    page = tmp_path / 'report.html'
    page.write_text('mine')
    assert main([str(spoil(tmp_path / 'run')), '-o', str(page)]) == 2
    error = capsys.readouterr().err
    assert text in error and error.count('\n') == 1 and page.read_text() == 'mine'


def test_a_full_disk_overwrites_nothing(bag, tmp_path, monkeypatch, capsys):
    page = tmp_path / 'report.html'
    page.write_text('mine')

    def write_text(path, text, encoding):
        path.write_bytes(text[:9].encode(encoding))
        raise OSError(28, 'No space left on device')
    monkeypatch.setattr('pathlib.Path.write_text', write_text)
    assert main([str(bag), '-o', str(page)]) == 2
    assert 'No space left' in capsys.readouterr().err
    assert page.read_text() == 'mine' and [*tmp_path.iterdir()] == [page]


def cut(path):
    file, = path.glob('*.mcap')
    file.write_bytes(file.read_bytes()[:5000])
    return path


def foreign(path):
    path.with_suffix('.mcap').write_text('no bag')
    return path.with_suffix('.mcap')


def test_what_comes_from_outside_is_escaped(run, scene, tmp_path):
    reason = run.statuses.reason.copy()
    reason[50:] = HOSTILE
    spoilt = dataclasses.replace(
        run, namespace=f'/{HOSTILE}', statuses=with_columns(
            run.statuses, reason=reason, reason_code=0 * run.statuses.reason_code),
        info=dataclasses.replace(run.info, sensor=HOSTILE),
        images=dataclasses.replace(run.images, unit=HOSTILE))
    path, summary = tmp_path / 'report.html', summarise(spoilt, scene)
    make_report(path, Shown(HOSTILE, spoilt, summary), Shown(
        HOSTILE, spoilt, summary, dataclasses.replace(scene, name=HOSTILE, description=HOSTILE),
        truth(run, scene)))
    page = read_page(path)
    assert page.tags.count('script') == 3 and not page.tags.count('img')
    assert 'not tracked' in page.text and page.text.count(HOSTILE) > 8
    assert page.data['run'][0]['stages'][1][1] == HOSTILE


@pytest.mark.skipif(shutil.which('node') is None, reason='node is not installed')
def test_scripts_are_javascript(run, tmp_path):
    page = read_page(report(tmp_path / 'report.html', run, summarise(run)))
    (tmp_path / 'all.js').write_text(''.join(page.scripts))
    subprocess.run(['node', '--check', tmp_path / 'all.js'], check=True)


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
    report(tmp_path / 'report.html', touched, summarise(touched, scene), scene,
           truth(touched, scene))
    assert 'Surface' in (page := read_page(tmp_path / 'report.html', 7)).text
    first, second = (unpacked(it['y'], '<f4') for it in page.data['chart'][-2]['series'])
    np.testing.assert_allclose(first[-20:], 1.0 / radius, rtol=0.02)
    np.testing.assert_allclose(second[-20:], 1.0 / radius, rtol=0.02)


@pytest.mark.parametrize('state', [*State, 42])  # 42: of another version
def test_report_of_a_run_in_one_state(run, scene, tmp_path, state):
    stuck = dataclasses.replace(run, statuses=with_columns(
        run.statuses, state=np.full_like(run.statuses.state, state)))
    summary = summarise(stuck, scene)
    report(tmp_path / 'report.html', stuck, summary, scene, truth(stuck, scene))
    read_page(tmp_path / 'report.html')


def test_latencies_below_zero_are_drawn(run):
    blind = dataclasses.replace(run, images=run_module._images([]), info=dataclasses.replace(
        run.info, acquisition_delay=1.0), stamps={**run.stamps, 'image': np.empty(0, int)})
    it, = charts.latency(Shown('bag', blind, summarise(blind)))
    assert unpacked(it['series'][0]['x'], '<f4')[-1] == 0.0


def test_a_single_cycle_of_a_goal_has_a_time_axis(run):
    state = np.zeros_like(run.statuses.state)
    state[100] = State.TRACK
    one = dataclasses.replace(run, statuses=with_columns(run.statuses, state=state))
    assert [it['domain'] for it in charts.over_time(Shown('bag', one, summarise(one)))] == (
        3 * [None])


@pytest.mark.parametrize('kept', range(len(TOPICS)))
def test_bags_with_one_topic_give_empty_arrays_and_reports(scene, tmp_path, kept):
    bare = read_run(write_bag(tmp_path / 'run', topics=TOPICS[kept:kept + 1]))
    assert (bare.info is None) == (kept != 1)
    assert len(bare.images.stamp_ns) == len(bare.images.frames) == (
        len(bare.images.sequence) if kept == 0 else 0)
    assert bare.poses.matrix.shape[1:] == (4, 4)
    summary = summarise(bare, scene)
    read_page(report(tmp_path / 'report.html', bare, summary, scene, truth(bare, scene)))
    read_page(report(tmp_path / 'recording.html', bare, summarise(bare)))


def test_report_of_a_recording(run, tmp_path):
    idle = dataclasses.replace(run, statuses=with_columns(
        run.statuses, state=np.full_like(run.statuses.state, State.IDLE)))
    page = read_page(report(tmp_path / 'report.html', idle, summarise_recording(run)), 3)
    assert 'contacts in' in page.text and 'Recording of a sensor' in page.text


def test_graph_needs_neither_matplotlib_nor_rosbags():
    code = ('import sys, edge_tracking.graph, edge_tracking.track; '
            'sys.exit(bool({"matplotlib", "rosbags.rosbag2"} & set(sys.modules)))')
    assert subprocess.run([sys.executable, '-c', code], check=False).returncode == 0


def test_the_page_says_what_the_nodes_ran_with(run, tmp_path):
    versions = {'versions': 'numpy 2', 'command': 'demo --seed 1'}
    told = dataclasses.replace(
        run, goals=[{'speed': 0.01}, {'speed': 0.03, 'features': '<b>'}], parameters={
            'edge_servo': {**versions, 'approach.speed': 0.5,
                           'tip_frame': NodeConfig.tip_frame},
            'contact_estimator': {**versions, 'not of this version': 1}, 'unknown': {},
            'track': {**versions, 'command': 'track --speed 0.03'}})
    summary = summarise(run)
    text = read_page(report(tmp_path / 'report.html', told, summary)).text
    assert 'edge_servo, not as by default approach.speed 0.5 ' in text
    assert 'contact_estimator, not as by default none' in text and 'not of this' not in text
    assert 'speed 0.03, features <b>' in text and 'speed 0.01' not in text
    assert 'command track --speed 0.03' in text and 'demo --seed 1' not in text
