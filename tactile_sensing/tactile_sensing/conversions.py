"""
Conversions between the core's data and ROS messages; all of them are in this module.

Messages that are published for every image can be reused: the argument `into` takes a message to
fill. Building a new one takes several times as long, and a published message is free again.
"""
from array import array
from dataclasses import fields
from functools import lru_cache
import math
from typing import Any

from geometry_msgs.msg import WrenchStamped
import numpy as np

from tactile_common.errors import TactileError
from tactile_common.ros.conversions import set_stamp, stamp_from_ns, stamp_to_ns
from tactile_msgs import msg as tactile_msgs
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Contact, ContactType, MATRIX, REALS, Reason
from tactile_sensing.types.image import COMPONENTS, Layer, SensorInfo, TactileImage
from tactile_sensing.types.moments import Moments

#: Type of the pixels of an Image, by encoding.
ENCODINGS = {'mono8': 'u1', '8UC1': 'u1', 'mono16': 'u2', '16UC1': 'u2', '32FC1': 'f4'}
# Fields with the same name in the message.
_INFO_TEXTS = ('sensor', 'model', 'serial_number', 'calibration')
_INFO_REALS = ('nominal_rate', 'acquisition_delay', 'skin_stiffness', 'max_load')
_LAYER_REALS = ('depth', 'full_scale', 'noise_std', 'poisson', 'gain_spread', 'floor', 'force_std')
# Images of one sensor share their geometry, including the computed centres.
_array = lru_cache(maxsize=16)(TactelArray)


def image_to_msg(image: TactileImage, into: Any = None) -> Any:
    """Return the TactileImage message of an image; the field of the device's time is not set."""
    message = tactile_msgs.TactileImage() if into is None else into
    message.sensor, message.sequence = image.sensor, image.sequence
    message.tared, message.saturated = image.tared, image.saturated
    if len(message.layers) != len(image.layers):
        message.layers = [tactile_msgs.TactileLayer() for _ in image.layers]
    for layer, layer_message in zip(image.layers, message.layers, strict=True):
        _layer_to_msg(layer, layer_message)
    return _set_header_and_array(message, image)


def image_from_msg(message: Any) -> TactileImage:
    """
    Return the image of a TactileImage message; its stress shares the message's memory.

    Raises a TactileError if the geometry is impossible or a layer has a wrong size.
    """
    geometry = _array(message.rows, message.columns, message.pitch_x, message.pitch_y)
    return TactileImage(
        stamp_ns=stamp_to_ns(message.header.stamp), sequence=message.sequence,
        layers=tuple(_layer_from_msg(layer, geometry.shape) for layer in message.layers),
        array=geometry, tared=message.tared, saturated=message.saturated,
        frame_id=message.header.frame_id, sensor=message.sensor)


def counts_from_msg(message: Any, shape: tuple[int, int]) -> np.ndarray:
    """
    Return the raw values (rows, columns) of an Image or a MultiArray of numbers.

    A MultiArray without a layout is assumed to have the given shape. Raises a TactileError if the
    message has another shape, or its data do not match.
    """
    if hasattr(message, 'encoding'):
        if message.encoding not in ENCODINGS:
            raise TactileError(
                f'encoding is {message.encoding!r}, must be one of {", ".join(ENCODINGS)}')
        kind = np.dtype(ENCODINGS[message.encoding])
        found, data = (message.height, message.width), np.frombuffer(message.data, np.uint8)
        whole = data[:data.size // kind.itemsize * kind.itemsize]
        values = whole.view(kind.newbyteorder('>' if message.is_bigendian else '<')).astype(kind)
    else:
        values = np.asarray(message.data)
        found = tuple(dim.size for dim in message.layout.dim) or shape
    if found != shape:
        raise TactileError(f'image is {"x".join(map(str, found))}, must be {shape[0]}x{shape[1]}, '
                           'rows x columns of the calibration')
    if values.size != math.prod(shape):
        raise TactileError(f'data holds {values.size} values, must hold {math.prod(shape)}, '
                           'without padding')
    return values.reshape(shape)


def sensor_info_to_msg(info: SensorInfo) -> Any:
    """Return the SensorInfo message of a SensorInfo record."""
    message = tactile_msgs.SensorInfo(
        layers=[_layer_to_msg(layer, tactile_msgs.TactileLayer()) for layer in info.layers],
        dead_tactels=array('I', info.dead_tactels), tared_at=stamp_from_ns(info.tared_at_ns),
        **{name: getattr(info, name) for name in _INFO_TEXTS},
        **{name: float(getattr(info, name)) for name in _INFO_REALS})
    return _set_header_and_array(message, info)


def sensor_info_from_msg(message: Any) -> SensorInfo:
    """
    Return the SensorInfo record of a message; its floats have single precision.

    Raises a TactileError if the geometry is impossible.
    """
    return SensorInfo(
        stamp_ns=stamp_to_ns(message.header.stamp), frame_id=message.header.frame_id,
        array=_array(message.rows, message.columns, message.pitch_x, message.pitch_y),
        dead_tactels=tuple(message.dead_tactels),
        layers=tuple(_layer_from_msg(layer, (0,)) for layer in message.layers),
        tared_at_ns=stamp_to_ns(message.tared_at),
        **{name: getattr(message, name) for name in (*_INFO_TEXTS, *_INFO_REALS)})


_TYPES = frozenset(map(int, ContactType))
_MOMENTS = tuple(field.name for field in fields(Moments))


def contact_to_msg(
        contact: Contact, image_message: Any, now_ns: int, into: Any = None) -> Any:
    """
    Return the Contact message of an estimate.

    Header, sensor and sequence are copied from the source image; now_ns is the time of
    publication, for the latency.
    """
    message = tactile_msgs.Contact() if into is None else into
    _copy_header(image_message.header, message.header)
    message.sensor = image_message.sensor
    message.sequence, message.type = image_message.sequence, int(contact.type)
    message.valid, message.force_valid = bool(contact.valid), bool(contact.force_valid)
    message.reasons = int(contact.reasons)
    message.method, message.model = contact.method, contact.model
    message.iterations = contact.iterations
    for name in REALS:
        setattr(message, name, float(getattr(contact, name)))
    message.covariance = contact.covariance.reshape(-1)
    message.moments = np.array([getattr(contact.moments, name) for name in _MOMENTS])
    x, y = contact.moments.centre_of_pressure
    centre = message.centre_of_pressure
    centre.x, centre.y = float(x), float(y)
    centre.z = 0.0 if math.isfinite(x) else math.nan
    set_stamp(message.latency, now_ns - stamp_to_ns(image_message.header.stamp))
    return message


def contact_from_msg(message: Any) -> Contact:
    """Return the estimate of a Contact message; raise a TactileError if its type is unknown."""
    if message.type not in _TYPES:
        raise TactileError(
            f'contact type is {message.type}, must be at most {max(ContactType)}')
    return Contact(
        type=ContactType(message.type), valid=message.valid, force_valid=message.force_valid,
        reasons=Reason(message.reasons),
        method=message.method, model=message.model, iterations=message.iterations,
        covariance=np.array(message.covariance).reshape(MATRIX),
        moments=Moments(*map(float, message.moments)),
        **{name: getattr(message, name) for name in REALS})


def contact_to_wrench(contact: Contact, image_message: Any, into: Any = None) -> WrenchStamped:
    """
    Return the force of the object on the sensor, at the origin of the sensor frame.

    z points out of the skin, so that a press has a negative z; shear that the contact's type
    does not have is 0.
    """
    message = WrenchStamped() if into is None else into
    _copy_header(image_message.header, message.header)
    force, torque = message.wrench.force, message.wrench.torque
    force.x, force.y = (0.0 if math.isnan(shear) else float(shear)
                        for shear in (contact.shear_force_x, contact.shear_force_y))
    force.z = -float(contact.normal_force)
    # The place (x, y, 0) times the force.
    torque.x, torque.y = float(contact.y * force.z), float(-contact.x * force.z)
    torque.z = float(contact.x * force.y - contact.y * force.x)
    return message


def _copy_header(source: Any, header: Any) -> None:
    header.stamp.sec, header.stamp.nanosec = source.stamp.sec, source.stamp.nanosec
    header.frame_id = source.frame_id


def _set_header_and_array(message: Any, source: TactileImage | SensorInfo) -> Any:
    header, geometry = message.header, source.array
    header.stamp, header.frame_id = stamp_from_ns(source.stamp_ns), source.frame_id
    message.rows, message.columns = geometry.rows, geometry.columns
    message.pitch_x, message.pitch_y = float(geometry.pitch_x), float(geometry.pitch_y)
    return message


def _layer_to_msg(layer: Layer, message: Any) -> Any:
    # The message would copy a list or an ndarray value by value.
    stress = array('f')
    stress.frombytes(np.ascontiguousarray(layer.stress, np.float32).tobytes())
    message.component, message.unit = COMPONENTS.index(layer.component), layer.unit
    message.stress = stress
    for name in _LAYER_REALS:
        setattr(message, name, float(getattr(layer, name)))
    message.skin_thickness = float(layer.thickness) if layer.thickness < math.inf else 0.0
    return message


def _layer_from_msg(layer: Any, shape: tuple[int, ...]) -> Layer:
    if layer.component >= len(COMPONENTS):
        raise TactileError(
            f'component is {layer.component}, must be below {len(COMPONENTS)}')
    stress = np.asarray(layer.stress, np.float32)
    if stress.size != math.prod(shape):
        raise TactileError(
            f'stress has {stress.size} values, must be {" x ".join(map(str, shape))}')
    # Images in older bags lack some fields.
    known = {name: getattr(layer, name) for name in _LAYER_REALS if hasattr(layer, name)}
    return Layer(COMPONENTS[layer.component], stress=stress.reshape(shape), unit=layer.unit,
                 thickness=getattr(layer, 'skin_thickness', 0.0) or math.inf, **known)
