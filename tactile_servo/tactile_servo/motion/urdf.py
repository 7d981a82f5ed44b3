"""Checked pinocchio model of the joints in a URDF that move a frame."""

from xml.etree import ElementTree

import numpy as np
import pinocchio

from tactile_common.errors import ConfigurationError

MOVING = ('revolute', 'prismatic', 'continuous')
MAX_BYTES = 16 << 20  # largest size of a URDF
WIDEST_RANGE = 16.0 * np.pi  # rad from limit to limit; wider limits are in degrees


def text_of(description: str) -> str:
    """
    Return the XML of a robot description, given as XML or as the path of a file.

    Raises a ConfigurationError if the description is empty, or if the file cannot be read, is too
    large or is not UTF-8 text.
    """
    if '<' in description:
        return description
    if not description.strip():
        raise ConfigurationError('robot description: is empty')
    try:
        with open(description, 'rb') as stream:
            raw = stream.read(MAX_BYTES + 1)
        if len(raw) > MAX_BYTES:
            raise ConfigurationError(
                f'robot description {description!r}: has more than {MAX_BYTES} bytes')
        return raw.decode('utf-8')
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, 'strerror', None) or 'not a text in UTF-8'
        raise ConfigurationError(f'robot description {description!r}: {reason}') from None


def parse(xml: str) -> ElementTree.Element:
    """Return the <robot> element of a URDF."""
    try:
        robot = ElementTree.fromstring(xml)
    except ElementTree.ParseError as error:
        raise ConfigurationError(f'robot description: malformed XML, {error}') from None
    if robot.tag != 'robot':
        raise ConfigurationError(
            f'robot description: the outermost element must be <robot>, not <{robot.tag}>')
    return robot


def chain_to(robot: ElementTree.Element,
             tip_frame: str) -> tuple[list[ElementTree.Element], str]:
    """Return the joint elements from the root link to the tip frame, and the root link's name."""
    links = [link.get('name', '') for link in robot.findall('link')]
    if tip_frame not in links:
        raise ConfigurationError(
            f'tip_frame {tip_frame!r}: the robot has no such frame; it has {", ".join(links)}')
    parents: dict[str, ElementTree.Element] = {}
    for joint in robot.findall('joint'):
        if not {_end(joint, 'parent'), _end(joint, 'child')} <= set(links):
            raise _wrong(joint, 'needs a parent and a child link of the robot')
        parents[_end(joint, 'child')] = joint
    chain: list[ElementTree.Element] = []
    link = tip_frame
    while link in parents:
        joint = parents[link]
        if joint in chain:
            raise _wrong(joint, 'the links form a loop')
        if joint.get('type') not in (*MOVING, 'fixed'):
            raise _wrong(joint, f'type {joint.get("type")!r} is not supported, only '
                         f'{", ".join(MOVING)} and fixed')
        if not joint.get('name'):
            raise _wrong(joint, 'needs a name')
        if joint.find('mimic') is not None:
            raise _wrong(joint, 'mimic joints are not supported')
        chain.insert(0, joint)
        link = _end(joint, 'parent')
    return chain, link


def _wrong(joint: ElementTree.Element, why: str) -> ConfigurationError:
    return ConfigurationError(f'joint {joint.get("name")!r}: {why}')


def _end(joint: ElementTree.Element, kind: str) -> str:
    """Return the name of a joint's 'parent' or 'child' link; empty if it has none."""
    element = joint.find(kind)
    return '' if element is None else element.get('link', '')


def _number(joint: ElementTree.Element, element: ElementTree.Element | None, key: str,
            otherwise: float | None = None) -> float:
    """Return a joint's attribute as a number; if missing, return `otherwise` or raise."""
    text = None if element is None else element.get(key)
    if text is None and otherwise is not None:
        return otherwise
    try:
        value = float('nan' if text is None else text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise _wrong(joint, f'limit {key} must be a number, '
                     f'{"is missing" if text is None else f"is {text!r}"}')
    return value


def _refuse_no_axis(joint: ElementTree.Element) -> None:
    axis = joint.find('axis')
    try:
        turns = axis is None or any(float(value) for value in axis.get('xyz', '1 0 0').split())
    except ValueError:  # pinocchio reports the error
        turns = True
    if not turns:
        raise _wrong(joint, 'its axis is 0 0 0')


def limits_of(joint: ElementTree.Element) -> tuple[float, float, float]:
    """Return a moving joint's lower, upper and velocity limit; soft limits restrict further."""
    _refuse_no_axis(joint)
    limit = joint.find('limit')
    lower, upper = (-np.inf, np.inf) if joint.get('type') == 'continuous' else (
        _number(joint, limit, 'lower'), _number(joint, limit, 'upper'))
    velocity = _number(joint, limit, 'velocity')
    if joint.get('type') == 'revolute' and upper - lower > WIDEST_RANGE:
        raise _wrong(joint, f'limits {lower} to {upper} must be in rad')
    soft = joint.find('safety_controller')
    if soft is not None and not np.isinf(lower):
        lower = max(lower, _number(joint, soft, 'soft_lower_limit', lower))
        upper = min(upper, _number(joint, soft, 'soft_upper_limit', upper))
    if lower >= upper:
        raise _wrong(joint, f'limit lower {lower} must be below upper {upper}')
    if velocity <= 0.0:
        raise _wrong(joint, f'limit velocity {velocity} must be above 0')
    return lower, upper, velocity


def pinocchio_model(robot: ElementTree.Element, chain: list[ElementTree.Element],
                    root: str) -> pinocchio.Model:
    """Build a model of the chain only, without side branches, inertias and meshes."""
    stripped = ElementTree.Element('robot', name=robot.get('name', 'robot'))
    for name in [root] + [_end(joint, 'child') for joint in chain]:
        ElementTree.SubElement(stripped, 'link', name=name)
    for joint in chain:
        kind = joint.get('type', '')
        element = ElementTree.SubElement(
            stripped, 'joint', name=joint.get('name', ''),
            type='revolute' if kind == 'continuous' else kind)
        element.extend(joint.findall(part)[0] for part in ('parent', 'child', 'origin', 'axis')
                       if joint.find(part) is not None)
        if kind != 'fixed':
            ElementTree.SubElement(  # not used, but the parser needs limits
                element, 'limit', lower='-1', upper='1', velocity='1', effort='0')
    try:
        return pinocchio.buildModelFromXML(ElementTree.tostring(stripped, encoding='unicode'))
    except (ValueError, RuntimeError) as error:
        reason = ' '.join(str(error).split())
        raise ConfigurationError(f'robot description: {reason}') from None
