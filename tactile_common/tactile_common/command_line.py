"""Command lines that refuse as everything else does, in one line."""
import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
import sys
from typing import Any, NoReturn

from tactile_common.config import checked
from tactile_common.errors import ConfigurationError, TactileError


class Parser(argparse.ArgumentParser):
    """Parser of whole option names; ConfigurationError in place of usage and an exit."""

    def __init__(self, **kwargs: Any):
        super().__init__(allow_abbrev=False, **kwargs)

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


@contextmanager
def reading_bags() -> Iterator[None]:
    """Say in one line what is missing where modules that read bags are imported."""
    try:
        yield
    except ImportError as error:
        raise ConfigurationError(f"{error}: reading a bag needs ROS 2's messages and rosbags: pip "
                                 "install 'rosbags>=0.10'") from error


def run_command(name: str, run: Callable[[], str]) -> int:
    """
    Say on standard error what a command did, or in one line what is wrong with what it was given.

    Returns the exit status: 0, 1 after an error, 130 where it was interrupted.
    """
    try:
        print(run(), file=sys.stderr)
    except (TactileError, OSError) as error:
        print(f'{name}: {" ".join(str(error).split())}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f'{name}: interrupted, nothing written', file=sys.stderr)
        return 130
    return 0
