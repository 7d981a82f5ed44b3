"""The report and the site in headless Chromium, on a wide and on a narrow screen."""
import json
from pathlib import Path
import re
import shutil
import subprocess

import pytest

from edge_tracking.recording.summary import summarise, truth
from edge_tracking.report.page import make_report, Shown

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
    done = subprocess.run(
        [BROWSER, '--headless', '--no-sandbox', '--disable-gpu', '--allow-file-access-from-files',
         '--enable-logging=stderr', f'--user-data-dir={folder / "profile"}',
         '--hide-scrollbars', '--virtual-time-budget=120000', '--window-size=1300,900',
         '--dump-dom', start.as_uri()], capture_output=True, text=True, timeout=300)
    result = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.S)
    assert result, done.stderr[-2000:]
    return json.loads(result[1]), re.findall(r'CONSOLE[^\n]*', done.stderr)


def faults(found):
    """Lines about pages that are wider than the screen, or lack pictures."""
    return [f'{Path(it["page"]).name} at {it["width"]} px: {it["whole"]} px, '
            f'{it["wide"][:5]}, {it["broken"]}' for it in found
            if it['whole'] > it['width'] or it['wide'] or it['broken']]


def test_report(run, scene, tmp_path):
    summary = summarise(run, scene)
    known = Shown('bag', run, summary, scene, truth(run, scene))
    pages = [tmp_path / 'report.html', tmp_path / 'two.html']
    make_report(pages[0], known)
    make_report(pages[1], known, known)
    found, console = measured(pages, tmp_path)
    assert len(found) == 2 * len(WIDTHS) and all(len(it['drawn']) > 8 for it in found)
    assert all('track' in said for it in found for said in it['players'])
    assert all(drawn > 1000 for it in found for drawn in it['drawn'])
    assert faults(found) == [] and console == []


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
