"""Topics of the graph, and how to identify them in a recording."""
from collections.abc import Callable, Collection, Iterator
from os import PathLike

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, WrenchStamped
from nav_msgs.msg import Path
from rcl_interfaces.msg import ParameterEvent
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

from edge_tracking.resources import NAMESPACE
from tactile_common.errors import ConfigurationError
from tactile_common.ros.bag_reader import Bag, Recorded
from tactile_common.ros.message_definitions import type_name
from tactile_msgs.msg import (
    Contact,
    SensorInfo,
    ServoCalls,
    ServoStatus,
    SurfacePatch,
    TactileImage,
)

OF_SENSORS = ('image', 'contact', 'servo_status')  # they identify a sensor's namespace
OF_ROBOTS = ('joint_states', 'joint_trajectory')  # in any namespace
NEEDED = {'image', 'sensor_info', 'joint_states', 'servo_calls'}  # for a replay


def topics(namespace: str) -> list[tuple[str, type, QoSProfile]]:
    """Return every topic of the graph with its type and quality of service for subscribers."""
    # Deep queues: at 1 kHz, a recorder that has no time for a second loses nothing.
    deep = QoSProfile(depth=1000)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    settings = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    sensor = QoSProfile(depth=1000, reliability=qos_profile_sensor_data.reliability)
    own = [('image', TactileImage, sensor), ('sensor_info', SensorInfo, latched),
           ('contact', Contact, sensor), ('wrench', WrenchStamped, sensor),
           ('surface_patch', SurfacePatch, deep), ('contour', Path, latched),
           ('markers', MarkerArray, latched), ('servo_status', ServoStatus, deep),
           ('surface_contact', PoseStamped, deep), ('sensor_pose', PoseStamped, sensor),
           ('servo_calls', ServoCalls, deep), ('parameters', ParameterEvent, settings)]
    prefix = f'/{namespace}'.rstrip('/')
    return [(f'{prefix}/{name}', kind, qos) for name, kind, qos in own] + [
        ('/diagnostics', DiagnosticArray, deep), ('/joint_states', JointState, deep),
        ('/joint_trajectory_controller/joint_trajectory', JointTrajectory, deep)]


def topics_to_record(namespace: str) -> list[tuple[str, type, QoSProfile]]:
    """Return every topic of `topics`, and those of a robot in the sensor's namespace."""
    both = topics(namespace)
    return both + [(f'/{namespace}{name}', kind, qos) for name, kind, qos in both
                   if namespace and short_name(name) in OF_ROBOTS]


def short_name(topic: str) -> str:
    """Return the last part of a topic's name, which is unique in the graph."""
    return topic.rpartition('/')[2]


KINDS = {short_name(name): kind for name, kind, _ in topics(NAMESPACE)}


class GraphBag(Bag):
    """
    A bag of this graph, with its topics by their names; topics of another type are ignored.

    `prefix` is the namespace of the sensor, '' or with a slash; `topic` are the topics by name,
    without empty ones, and `name` the names by topic. Without a namespace the sensor in `tactile`
    is taken, or the only one. Raises a ConfigurationError if the bag cannot be read, or has
    several sensors and none of them is taken.
    """

    def __init__(self, path: str | PathLike, namespace: str | None = None):
        super().__init__(path)
        found = self.namespaces({name: type_name(KINDS[name]) for name in OF_SENSORS})
        if namespace is not None:
            self.prefix = f'/{namespace.strip("/")}'.rstrip('/')
        elif not found or f'/{NAMESPACE}' in found:
            self.prefix = f'/{NAMESPACE}'
        elif len(found) == 1:
            self.prefix, = found
        else:
            raise ConfigurationError(
                f'bag {path}: holds several sensors, {", ".join(found)}; choose a namespace')
        own = {topic: short_name(topic) for topic, _, _ in topics(self.prefix.strip('/'))}
        robots = {topic: kind for kind in OF_ROBOTS for topic in self.topics
                  if topic.endswith(f'/{kind}')}
        # Of several robots, that in the sensor's namespace, or the one without a namespace.
        named = sorted({**own, **robots}.items(), key=lambda item: (
            item[0].startswith(f'{self.prefix}/'), item[0] in own))
        self.topic = {name: topic for topic, name in named
                      if self.topics.get(topic) == type_name(KINDS[name]) and self.count(topic)}
        self.name = {topic: name for name, topic in self.topic.items()}

    def readable(self, topics: Collection[str], fault: Callable[[str], None]
                 ) -> Iterator[Recorded]:
        """Yield the messages that can be read; `fault` gets the reason if there are others."""
        try:
            yield from self.messages(topics)
        except ConfigurationError as error:
            fault(str(error))

    def require_touch(self) -> None:
        """Raise a ConfigurationError if there is neither an image nor a contact."""
        if not {'image', 'contact'} & self.topic.keys():
            raise ConfigurationError(
                f'bag {self.path}: has no image and no contact of a tactile sensor in '
                f'{self.prefix or "/"}; there are {sorted(self.topics)}')
