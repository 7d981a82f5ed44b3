"""Command-line parsing, one-line error messages and JSON for all commands."""
import argparse
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
import json
from pathlib import Path
import sys
from traceback import extract_tb
from types import SimpleNamespace
from typing import Any, NoReturn

from tactile_common.config import checked
from tactile_common.errors import ConfigurationError, TactileError

PICTURES = ('.png', '.pdf', '.svg', '.jpg')  # formats that matplotlib writes
# Exit status of every command.
DONE, FAILED, REFUSED, INTERRUPTED = 0, 1, 2, 130


class Help(argparse.ArgumentDefaultsHelpFormatter, argparse.RawDescriptionHelpFormatter):
    """Help formatter that shows informative defaults and keeps the line breaks of the epilog."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        said = action.default is None or action.default is False
        return action.help if said else super()._get_help_string(action)


class Parser(argparse.ArgumentParser):
    """Parser without abbreviated options; it raises ConfigurationError and does not exit."""

    def __init__(self, **kwargs: Any):
        super().__init__(allow_abbrev=False, **kwargs)
        self.add_argument('--version', action='version', version=f'%(prog)s {version_of_all()}')

    def error(self, message: str) -> NoReturn:
        """Raise a ConfigurationError for invalid arguments."""
        raise ConfigurationError(f'{message}; see --help')


def between(low: float, high: float, unit: str = '', kind: type = float) -> Callable[[str], Any]:
    """Return the type of an option: a number between two bounds, both allowed."""
    def convert(text: str) -> Any:
        try:
            return checked('value', kind(text), kind, {'range': (low, high), 'unit': unit})
        except ConfigurationError as error:
            raise argparse.ArgumentTypeError(str(error)) from None
    convert.__name__ = kind.__name__  # argparse shows this name if `kind` refuses the text
    return convert


def version_of_all() -> str:
    """Return the version of these packages."""
    try:
        return version('tactile_common')  # all packages have the same version
    except PackageNotFoundError:
        return 'of a source tree that is not installed'


def file_to_write(*endings: str) -> Callable[[str], Path]:
    """Return the type of an option: a file in a folder that exists, with one of the endings."""
    def convert(text: str) -> Path:
        path = Path(text)
        if endings and path.suffix.lower() not in endings:
            raise argparse.ArgumentTypeError(f'{text}: must end in {" or ".join(endings)}')
        if path.is_dir() or not path.parent.is_dir():
            why = 'is a folder' if path.is_dir() else 'there is no such folder'
            raise argparse.ArgumentTypeError(f'{text}: {why}')
        return path
    return convert


def to_json(summary: Mapping[str, Any]) -> str:
    """Return a summary as one line of JSON; NaN and infinity become null."""
    text = json.dumps(summary, default=lambda of_numpy: of_numpy.tolist())
    return json.dumps(json.loads(text, parse_constant=lambda _: None))


@contextmanager
def refusing(name: str, *others: type[Exception]) -> Iterator[SimpleNamespace]:
    """
    Print errors of a command in one line.

    The yielded object's `status` is the exit status: 2 (`REFUSED`) after TactileError, OSError and
    the given types, 1 (`FAILED`) after other errors, which are defects of the command, 130 after
    an interrupt, otherwise the value that the command sets (initially 0).
    """
    command = SimpleNamespace(status=DONE)
    expected: tuple[type[Exception], ...] = (TactileError, OSError, *others)
    try:
        yield command
    except expected as error:
        print(f'{name}: {" ".join(str(error).split())}', file=sys.stderr)
        command.status = REFUSED
    except Exception as error:
        where = ' '.join(f'{Path(frame.filename).name}:{frame.lineno}'
                         for frame in extract_tb(error.__traceback__))
        print(f'{name}: defect: {type(error).__name__}: {" ".join(str(error).split())} '
              f'({where})', file=sys.stderr)
        command.status = FAILED
    except KeyboardInterrupt:
        print(f'{name}: interrupted', file=sys.stderr)
        command.status = INTERRUPTED


@contextmanager
def reading_bags() -> Iterator[None]:
    """Explain in one line what is missing if modules that read bags cannot be imported."""
    try:
        yield
    except ImportError as error:
        raise ConfigurationError(f"{error}: reading a bag needs ROS 2's messages and rosbags: pip "
                                 "install 'rosbags>=0.10'") from error


def run_command(name: str, run: Callable[[], str]) -> int:
    """Print the result of a command on standard error; return the exit status, see `refusing`."""
    with refusing(name) as command:
        print(run(), file=sys.stderr)
    return command.status
