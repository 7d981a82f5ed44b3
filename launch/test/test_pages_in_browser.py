"""Report, live view and site in headless Chromium, on a wide and on a narrow screen."""
from html import escape
import json
from pathlib import Path
import re
import shutil
import subprocess

import numpy as np
import pytest
from recorded_run import TOPICS, write_bag

from edge_tracking.recording.summary import read, summarise, truth
from edge_tracking.report.page import make_report, Shown
from edge_tracking.view import live_page
from edge_tracking.web.page import packed
from edge_tracking.web.server import Server

SITE = Path(__file__).resolve().parents[2] / '.ws/site'
WIDTHS = (1200, 390)  # px
NAMES = ('chromium', 'chromium-browser', 'google-chrome', 'chromium-headless-shell')
BROWSER = next(filter(None, map(shutil.which, NAMES)), None)
# Loads pages into frames of a width; leaves what it finds as JSON in the body.
MEASURE = """<!doctype html><body><script>
const pages = %s, widths = %s, found = [];
const clips = e => e && e.nodeType === 1 && (
  ['auto', 'scroll', 'hidden', 'clip'].includes(getComputedStyle(e).overflowX)
  || getComputedStyle(e).position === 'fixed' || clips(e.parentElement));
const measure = (page, width) => new Promise(done => {
  const frame = document.createElement('iframe');
  frame.style.width = width + 'px'; frame.style.height = '800px'; frame.style.border = '0';
  frame.onload = () => {
    const d = frame.contentDocument, name = e => e.tagName + '.' + e.className;
    const wide = [...d.body.querySelectorAll('*')].filter(e =>
      e.getBoundingClientRect().right > width + 1 && !clips(e.parentElement) && !clips(e));
    found.push({page, width, whole: d.documentElement.scrollWidth, wide: wide.map(name),
      broken: [...d.images].filter(i => !i.naturalWidth).map(i => i.src),
      players: [...d.querySelectorAll('.player p')].map(p => p.textContent),
      drawn: [...d.querySelectorAll('canvas')].map(c => c.toDataURL().length),
      images: d.images.length, words: d.body.innerText.length});
    frame.remove(); done();
  };
  frame.src = page; document.body.append(frame);
});
(async () => {
  for (const page of pages) for (const width of widths) await measure(page, width);
  document.body.innerHTML = '<pre id="found"></pre>';
  document.getElementById('found').textContent = JSON.stringify(found);
})();
</script></body>"""
pytestmark = pytest.mark.skipif(BROWSER is None, reason=f'none of {", ".join(NAMES)} is installed')


def measured(pages, folder):
    """What the browser finds of pages at each width, and what they write to its console."""
    start = folder / 'measure.html'
    start.write_text(MEASURE % (json.dumps([page.as_uri() for page in pages]), list(WIDTHS)))
    dom, console = opened(start.as_uri(), folder, 120)
    return json.loads(re.search(r'<pre id="found">(.*?)</pre>', dom, re.S)[1]), console


def opened(address, folder, seconds):
    """The elements of a page after some time of its own, and what it writes to the console."""
    done = subprocess.run(
        [BROWSER, '--headless', '--no-sandbox', '--disable-gpu', '--allow-file-access-from-files',
         '--enable-logging=stderr', f'--user-data-dir={folder / "profile"}',
         '--hide-scrollbars', f'--virtual-time-budget={1000 * seconds}',
         '--window-size=1300,900', '--dump-dom', address],
        capture_output=True, text=True, timeout=300)
    assert '<body' in done.stdout, done.stderr[-2000:]
    return done.stdout, re.findall(r'CONSOLE[^\n]*', done.stderr)


def faults(found):
    """Lines about pages that are wider than the screen, or lack pictures."""
    return [f'{Path(it["page"]).name} at {it["width"]} px: {it["whole"]} px, '
            f'{it["wide"][:5]}, {it["broken"]}' for it in found
            if it['whole'] > it['width'] or it['wide'] or it['broken']]


def test_report(run, scene, tmp_path):
    summary = summarise(run, scene)
    known = Shown('bag', run, summary, scene, truth(run, scene))
    pages = [tmp_path / name for name in ('report.html', 'two.html', 'blind.html')]
    make_report(pages[0], known)
    make_report(pages[1], known, known)
    make_report(pages[2], read(write_bag(tmp_path / 'blind', topics=TOPICS[4:6])))
    found, console = measured(pages, tmp_path)
    # Of each run the image, the way, place twice, force, view from above, contacts, latency.
    # Without images and contour the way, place twice, force, latency.
    assert [len(it['drawn']) for it in found] == [8, 8, 16, 16, 5, 5]
    assert all('track' in said for it in found for said in it['players'])
    assert all(drawn > 1000 for it in found for drawn in it['drawn'])
    assert faults(found) == [] and console == []


def test_live_view(tmp_path):
    server = Server('127.0.0.1', 0, live_page())
    hostile = '</p><img src=x onerror=console.error(1)>'
    place = {'x': -1e-6, 'y': 2e-3, 'yaw': -1e-6, 'start': None, 'end': None,
             'covariance': [1e-8, 0.0, 4e-8]}
    server.newest = json.dumps({
        'image': {'rows': 2, 'columns': 3, 'unit': 'Pa', 'pitch': [1e-3, 1e-3], 'top': 5e4,
                  'rate': 200.0, 'sensor': hostile, 'tared': False,
                  'levels': packed(np.array([0, 254, 255, 3, 4, 5]), 'u1')},
        'contact': {'type': 'line', 'place': place, 'force': 4.996, 'reasons': ''},
        'status': {'state': 'track', 'reason': hostile, 'speed': None, 'progress': 0.03},
        'position': [0.1, 0.2, None], 'stamp': 1}).encode()
    dom, console = opened(server.url, tmp_path, 5)
    server.close()
    said = dict(re.findall(r'<p id="(\w+)">(.*?)</p>', dom))
    shown = escape(hostile, quote=False)
    assert said == {
        'contact': 'line · x 0.00 mm · y 2.00 mm · 0.0 ° · 5.00 N',
        'servo': f'track · {shown} · 30.0 mm so far',
        'sensor': f'{shown}: 2 × 3, 200 Hz, darkest 5.00e+4 Pa, not tared'}
    assert '<img' not in dom and console == []


@pytest.mark.skipif(not (SITE / 'index.html').is_file(), reason='no site yet: ./ws docs')
def test_site(tmp_path):
    pages = sorted(SITE.glob('*.html'))
    found, console = measured(pages, tmp_path)
    assert len(found) == len(WIDTHS) * len(pages) > 40
    assert min(it['words'] for it in found) > 0
    assert faults(found) == [] and console == []


def test_faults_are_found(tmp_path):
    page = tmp_path / 'page.html'
    page.write_text('<!doctype html><body><div style="width:800px">x</div><img src="no.png">'
                    '<div style="overflow-x:auto"><p style="width:3000px">y</p></div>'
                    '<script>console.error("no")</script></body>')
    found, console = measured([page], tmp_path)
    wide, narrow = faults(found)
    assert 'at 1200 px: 1200 px, [], [' in wide and 'no.png' in wide
    assert 'at 390 px: 8' in narrow and "['DIV.']" in narrow
    assert any('no' in line for line in console)
