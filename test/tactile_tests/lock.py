"""
Write the SHA-256 of every file that pip may install into ws.lock and docs/site.lock.

  python3 -m tactile_tests.lock

To renew a pinned version, change it in the file and run this. pip is asked, for each Python
that ./ws takes, which file it would choose; nothing is installed.
"""
from collections.abc import Iterator
import json
from pathlib import Path
import subprocess
import sys
from tempfile import TemporaryDirectory

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
PYTHONS = ('3.10', '3.11', '3.12', '3.13', '3.14')
LOCKS = {'ws.lock': PYTHONS, 'docs/site.lock': PYTHONS[1:]}  # the latter for the site's
# Of the C library of Ubuntu 22.04 and before, the newest first, as pip prefers them.
ALIASES = {17: '2014', 12: '2010', 5: '1'}
PLATFORMS = [platform for minor in range(35, 4, -1) for platform in (
    f'manylinux_2_{minor}_x86_64',
    *([f'manylinux{ALIASES[minor]}_x86_64'] if minor in ALIASES else []))] + ['linux_x86_64']
FROM_SOURCE = 'empy'  # has no wheel


def pinned(text: str) -> Iterator[tuple[str, Requirement | None]]:
    """Lines of a lock file without their hashes, with the requirement that is in them."""
    for line in text.splitlines():
        line = line.removesuffix('\\').rstrip()
        if not line.startswith('    --hash='):
            comment = not line or line.startswith('#')
            yield line, None if comment else Requirement(line)


def hashes(requirements: list[Requirement], python: str) -> dict[str, str]:
    """SHA-256 of the file that pip chooses for each requirement and a Python, by its name."""
    wanted = [f'{it.name}{it.specifier}' for it in requirements
              if it.marker is None or it.marker.evaluate({'python_version': python})]
    with TemporaryDirectory() as folder:
        report = Path(folder, 'report.json')
        subprocess.run(
            [sys.executable, '-m', 'pip', 'install', '-q', '--dry-run', '--ignore-installed',
             '--no-deps', '--only-binary=:all:', f'--no-binary={FROM_SOURCE}',
             f'--python-version={python}', '--implementation=cp',
             *(f'--platform={it}' for it in PLATFORMS), f'--target={folder}',
             f'--report={report}', *wanted], check=True)
        chosen = json.loads(report.read_text('utf-8'))['install']
    return {canonicalize_name(it['metadata']['name']):
            it['download_info']['archive_info']['hashes']['sha256'] for it in chosen}


def main() -> None:
    """Renew both files."""
    for name, pythons in LOCKS.items():
        path = ROOT / name
        lines = list(pinned(path.read_text('utf-8')))
        found = [hashes([it for _, it in lines if it], python) for python in pythons]
        text = ''
        for line, requirement in lines:
            text += line
            if requirement:
                key = canonicalize_name(requirement.name)
                of_marker = (every for every, python in zip(found, pythons, strict=True)
                             if requirement.marker is None
                             or requirement.marker.evaluate({'python_version': python}))
                text += ''.join(f' \\\n    --hash=sha256:{sha}'
                                for sha in sorted({every[key] for every in of_marker}))
            text += '\n'
        path.write_text(text, 'utf-8')


if __name__ == '__main__':
    main()
