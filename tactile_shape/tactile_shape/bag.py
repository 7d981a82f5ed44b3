"""Reading contacts and poses from a rosbag2 recording; needs rosbags, and no running ROS."""
import struct

from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.ros.conversions import pose_from_msg, stamp_to_ns
from tactile_sensing.conversions import contact_from_msg, image_from_msg
from tactile_shape.contact_recording import place_contacts
from tactile_shape.contour.contact_path import needs_picture

TOPICS = ('contact', 'sensor_pose')
PICTURES = 'image'  # for bends and ends of edges; may be missing
WAITING = 200  # pictures that are kept for their contacts: a second of them
_MISSING = "reading a bag needs rosbags: pip install 'rosbags>=0.10'"


def read_bag(path, namespace=None, finger_radius=0.0):
    """
    Trace of a recording.

    Parameters
    ----------
    path : pathlib.Path
        Folder, or one of its .mcap or .db3 files.
    namespace : str, optional
        Of the sensor.
    finger_radius : float
        As of `contact_path.on_pad` [m].

    Raises
    ------
    ConfigurationError
        rosbags is missing, the bag is damaged, or the topics are not in it.
    """
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.rosbag2 import ReaderError
        from rosbags.serde import SerdeError
        from rosbags.typesys import get_typestore, Stores, TypesysError
    except ImportError as error:
        raise ConfigurationError(_MISSING) from error
    try:
        # The types are those in the bag; only where it has none, those of a distribution.
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            wanted = _topics({connection.topic for connection in reader.connections}, namespace)
            wanted += (wanted[0].removesuffix(TOPICS[0]) + PICTURES,)
            connections = [c for c in reader.connections if c.topic in wanted]
            events = list(_events(reader.deserialize(data, connection.msgtype)
                                  for connection, _, data in reader.messages(connections)))
    except ConfigurationError:
        raise
    except (AnyReaderError, ReaderError, SerdeError, TypesysError, struct.error, LookupError,
            AttributeError, TypeError, ValueError,
            TactileError) as error:
        text = ' '.join(str(error).split()) or type(error).__name__
        raise ConfigurationError(f'is not a recording of contacts: {text:.200}') from error
    return place_contacts(events, finger_radius)


def _topics(there, namespace):
    """Names of the two topics in a bag."""
    if namespace is not None:
        wanted = tuple(f'/{namespace.strip("/")}/{topic}'.replace('//', '/') for topic in TOPICS)
        if not set(wanted) <= there:
            raise ConfigurationError(f'has no {" and ".join(wanted)}, there are {sorted(there)}')
        return wanted
    found = [name.removesuffix('contact') for name in sorted(there) if name.endswith('/contact')]
    found = [prefix for prefix in found if f'{prefix}sensor_pose' in there]
    if len(found) != 1:
        raise ConfigurationError(
            f'has {len(found)} pairs of contact and sensor_pose; name one by --namespace; there '
            f'are {sorted(there)}')
    return tuple(found[0] + topic for topic in TOPICS)


def _events(messages):
    """Poses and contacts, these with the picture of their stamp where it is needed."""
    pictures = {}
    for message in messages:
        stamp = stamp_to_ns(message.header.stamp)
        if hasattr(message, 'pose'):
            yield stamp, pose_from_msg(message.pose), None, None
        elif hasattr(message, 'tared'):
            pictures[stamp] = message
            if len(pictures) > WAITING:
                del pictures[next(iter(pictures))]
        else:
            contact, picture = contact_from_msg(message), pictures.get(stamp)
            yield stamp, None, contact, image_from_msg(picture) if (
                needs_picture(contact) and picture is not None) else None
