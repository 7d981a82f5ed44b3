"""Which topics of a recording are which of this graph."""
from edge_tracking.process_group import topics
from tactile_common.errors import ConfigurationError
from tactile_common.ros.bag_reader import Bag


class Names:
    """Topics of a recording by the names that they have here; ConfigurationError if foreign."""

    def __init__(self, bag: Bag, namespace: str | None):
        kinds = {'image': 'tactile_msgs/msg/TactileImage', 'contact': 'tactile_msgs/msg/Contact'}
        found = bag.namespaces(kinds)
        if not found:
            raise ConfigurationError(
                f'bag {bag.path}: has no image and no contact of a tactile sensor; there are '
                f'{sorted(bag.topics)}')
        if namespace is not None or len(found) > 1:
            name = next(iter(found[f'/{(namespace or "").strip("/")}'.rstrip('/')]
                             if namespace is not None and f'/{namespace.strip("/")}' in found
                             else kinds))
            self.prefix = bag.namespace_of({name: kinds[name]}, namespace)
        else:
            self.prefix, = found
        self.of: dict[str, str] = {}  # name by topic
        for name, _, _ in topics(self.prefix.strip('/')):
            self.of[name] = name.rpartition('/')[2]
        for kind in ('joint_states', 'joint_trajectory'):  # of a robot in a namespace of its own
            self.of |= {topic: kind for topic in bag.topics if topic.endswith(f'/{kind}')}
        self.topic = {name: topic for topic, name in self.of.items() if bag.count(topic)}
