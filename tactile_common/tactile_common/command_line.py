"""Command lines that refuse as everything else does, in one line."""
import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
import sys
from types import SimpleNamespace
from typing import Any, NoReturn

from tactile_common.config import checked
from tactile_common.errors import ConfigurationError, TactileError

PICTURES = ('.png', '.pdf', '.svg', '.jpg')  # that matplotlib writes
# Exit status of every command.
DONE, FAILED, REFUSED, INTERRUPTED = 0, 1, 2, 130


class Help(argparse.ArgumentDefaultsHelpFormatter, argparse.RawDescriptionHelpFormatter):
    """Help with the defaults that say something, and the lines of the epilog as they are."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        said = action.default is None or action.default is False
        return action.help if said else super()._get_help_string(action)


class Parser(argparse.ArgumentParser):
    """Parser of whole option names; ConfigurationError in place of usage and an exit."""

    def __init__(self, **kwargs: Any):
        super().__init__(allow_abbrev=False, **kwargs)
        self.add_argument('--version', action='version', version=f'%(prog)s {version_of_all()}')

    def error(self, message: str) -> NoReturn:
        """Refuse what was given."""
        raise ConfigurationError(f'{message}; --help tells more')


def between(low: float, high: float, unit: str = '', kind: type = float) -> Callable[[str], Any]:
    """Type of an option: a number between two bounds, both allowed."""
    def convert(text: str) -> Any:
        try:
            return checked('value', kind(text), kind, {'range': (low, high), 'unit': unit})
        except ConfigurationError as error:
            raise argparse.ArgumentTypeError(str(error)) from None
    convert.__name__ = kind.__name__  # argparse names it where `kind` refuses the text
    return convert


def version_of_all() -> str:
    """Version of these packages."""
    try:
        return version('tactile_common')  # one for all
    except PackageNotFoundError:
        return 'of a source tree that is not installed'


def picture_file(text: str) -> Path:
    """Type of an option: a picture to write, in a folder that there is."""
    path = Path(text)
    if path.suffix.lower() not in PICTURES:
        raise argparse.ArgumentTypeError(f'{text}: must end in one of {", ".join(PICTURES)}')
    if not path.parent.is_dir():
        raise argparse.ArgumentTypeError(f'{text}: there is no such folder')
    return path


@contextmanager
def refusing(name: str, *others: type[Exception]) -> Iterator[SimpleNamespace]:
    """
    Say in one line what is wrong with what a command was given: our errors, and some others.

    The `status` of what is given is that to exit with: 2 after an error, which is `REFUSED`, 130
    where the command was interrupted; else what the command sets, 0 at first.
    """
    command = SimpleNamespace(status=DONE)
    expected: tuple[type[Exception], ...] = (TactileError, OSError, *others)
    try:
        yield command
    except expected as error:
        print(f'{name}: {" ".join(str(error).split())}', file=sys.stderr)
        command.status = REFUSED
    except KeyboardInterrupt:
        print(f'{name}: interrupted', file=sys.stderr)
        command.status = INTERRUPTED


@contextmanager
def reading_bags() -> Iterator[None]:
    """Say in one line what is missing where modules that read bags are imported."""
    try:
        yield
    except ImportError as error:
        raise ConfigurationError(f"{error}: reading a bag needs ROS 2's messages and rosbags: pip "
                                 "install 'rosbags>=0.10'") from error


def run_command(name: str, run: Callable[[], str]) -> int:
    """Say on standard error what a command did; returns the exit status, see `refusing`."""
    with refusing(name) as command:
        print(run(), file=sys.stderr)
    return command.status
