"""Command lines that refuse as everything else does, in one line."""
import argparse
from collections.abc import Callable
from typing import Any

from tactile_common.config import checked
from tactile_common.errors import ConfigurationError


class Parser(argparse.ArgumentParser):
    """Parser of whole option names; ConfigurationError in place of usage and an exit."""

    def __init__(self, **kwargs):
        super().__init__(allow_abbrev=False, **kwargs)

    def error(self, message):
        """Refuse what was given."""
        raise ConfigurationError(f'{message}; --help tells more')


def between(low: float, high: float, unit: str = '', kind: type = float) -> Callable[[str], Any]:
    """Type of an option: a number between two bounds, both allowed."""
    def convert(text):
        try:
            return checked('value', kind(text), kind, {'range': (low, high), 'unit': unit})
        except ConfigurationError as error:
            raise argparse.ArgumentTypeError(str(error)) from None
    convert.__name__ = kind.__name__  # argparse names it where `kind` refuses the text
    return convert
