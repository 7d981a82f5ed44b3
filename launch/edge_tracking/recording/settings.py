"""Recorded parameters of the nodes, and changes to them."""
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from rclpy.parameter import parameter_value_to_python

from edge_tracking.parameters import NODES, parameters_of, SERVO
from edge_tracking.recording.topics import GraphBag
from tactile_common.config import did_you_mean
from tactile_common.errors import ConfigurationError, naming
from tactile_common.parameter_file import ParameterFile, refuse_unknown
from tactile_common.yaml_file import parse_yaml
from tactile_servo.laws.registry import DEFAULT, law_for, law_named
from tactile_servo.robot_config import NodeConfig

REPLAYED = ('contact_estimator', 'shape_estimator', SERVO)


class Settings:
    """
    Parameters by node: `recorded`, and `changed` values that override some of them.

    Recorded are those with which each node of a bag began, and the changes by a replay.
    """

    def __init__(self, bag: GraphBag):
        self.recorded: dict[str, dict[str, Any]] = {}
        self.changed: dict[str, dict[str, Any]] = {}
        with suppress(ConfigurationError, RuntimeError):  # reading all messages reports the error
            for row in bag.messages([bag.topic.get('parameters', '')]):
                message = row.message
                node = message.node.rpartition('/')[2]
                self.recorded.setdefault(node, _told(message.new_parameters)).update(
                    _told(message.changed_parameters))

    def change(self, wishes: Sequence[str], idle: Mapping[str, str]) -> None:
        """
        Apply changes NODE.PARAM=VALUE; ConfigurationError if node or parameter is unknown.

        `idle` tells of nodes that are not replayed why; their parameters are refused, too, and so
        is a law that cannot work on the recorded goals.
        """
        action = law_named(self.law).action if wishes else ''
        for wish in wishes:
            place, equals, text = wish.partition('=')
            node, _, name = place.partition('.')
            if not (name and equals):
                raise ConfigurationError(f'--set {wish}: must be NODE.PARAM=VALUE')
            if node not in REPLAYED:
                raise ConfigurationError(f'--set {wish}: no node {node} is replayed'
                                         f'{did_you_mean(node, REPLAYED)}')
            if node in idle:
                raise ConfigurationError(f'--set {wish}: {node} is not replayed, {idle[node]}')
            with naming(f'--set {wish}'):
                self.changed.setdefault(node, {})[name] = parse_yaml(text)
        for node, values in self.changed.items():
            with naming(f'--set {node}'):
                law_for(action, self.law)
                refuse_unknown(values, [it.name for it in parameters_of(node, self.law)])
                for kind in NODES[node]:
                    self.config(node, kind)

    def config(self, node: str, kind: type) -> Any:
        """Return a dataclass of the parameters of a node."""
        return ParameterFile().config(node, kind, {
            **self.recorded.get(node, {}), **self.changed.get(node, {})})

    @property
    def law(self) -> str:
        """Law of the servo."""
        return str(self.config(SERVO, NodeConfig).law) if self.has_robot else DEFAULT

    @property
    def has_robot(self) -> bool:
        """True if the servo's parameters are known."""
        return bool(self.recorded.get(SERVO, {}).get('robot_description'))


def _told(parameters: Sequence[Any]) -> dict[str, Any]:
    values = {it.name: parameter_value_to_python(it.value) for it in parameters}
    return {name: tuple(np.asarray(value).tolist()) if isinstance(value, list) else value
            for name, value in values.items() if value is not None}
