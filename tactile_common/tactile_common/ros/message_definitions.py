"""Definitions of message types, as stored in recordings."""
from functools import cache
import json
from pathlib import Path
from typing import NamedTuple

from ament_index_python.packages import get_package_share_directory

from tactile_common.errors import ConfigurationError

SEPARATOR = '=' * 80


class MessageDefinition(NamedTuple):
    """Definition of a message type."""

    name: str  # for instance 'std_msgs/msg/Header'
    text: str  # its .msg file and those of all nested types, with comments
    digest: str  # its RIHS01 hash


def type_name(message_class: type) -> str:
    """Return the name of a message class, for instance 'std_msgs/msg/Header'."""
    return f'{message_class.__module__.split(".")[0]}/msg/{message_class.__name__}'


def definition_of(message_class: type) -> MessageDefinition:
    """Return the definition of a message class; ConfigurationError if it is not installed."""
    return definition(type_name(message_class))


@cache
def definition(name: str) -> MessageDefinition:
    """Return the definition of a type by name; ConfigurationError if it is not installed."""
    try:
        description = json.loads(_interface_file(name, 'json').read_text(encoding='utf-8'))
        inner = [part['type_name'] for part in
                 description['type_description_msg']['referenced_type_descriptions']]
        digest = next(entry['hash_string'] for entry in description['type_hashes']
                      if entry['type_name'] == name)
        text, *texts = [_interface_file(part, 'msg').read_text(encoding='utf-8')
                        for part in (name, *inner)]
    except (OSError, LookupError, ValueError, StopIteration) as error:
        raise ConfigurationError(f'message type {name}: is not installed: {error}') from error
    return MessageDefinition(name, text + ''.join(
        f'\n{SEPARATOR}\nMSG: {part.replace("/msg/", "/")}\n{other}'
        for part, other in zip(inner, texts, strict=True)), digest)


def _interface_file(name: str, suffix: str) -> Path:
    package, folder, stem = name.split('/')
    return Path(get_package_share_directory(package), folder, f'{stem}.{suffix}')
