"""Gains and bounds of the tracing servo."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class TraceConfig:
    """Gains and bounds of the tracing servo."""

    lateral_gain: float = field(default=30.0, metadata={
        'doc': "rate at which the pad's distance from the traced edge is made up",
        'unit': '1/s', 'range': (1.0, 200.0)})
    force_gain: float = field(default=60.0, metadata={
        'doc': 'rate at which an error of the force is made up', 'unit': '1/s',
        'range': (1.0, 200.0)})
    force_integral: float = field(default=60.0, metadata={
        'doc': 'integral gain of the force', 'unit': '1/s^2', 'range': (0.0, 1e4)})
    press_acceleration: float = field(default=0.2, metadata={
        'doc': 'deceleration along the normal that the robot is trusted with as it presses',
        'unit': 'm/s^2', 'range': (1e-3, 100.0)})
    stiffness: float = field(default=5000.0, metadata={
        'doc': 'total stiffness of skin, finger and robot along the normal', 'unit': 'N/m',
        'range': (10.0, 1e7)})
    skin_stiffness: float = field(default=2.0e5, metadata={
        'doc': 'line force per length and indentation, which tells the height of the edge',
        'unit': 'N/m^2', 'range': (1e2, 1e9)})
    acceleration: float = field(default=2.0, metadata={
        'doc': 'largest acceleration of the pad in the plane of the edge', 'unit': 'm/s^2',
        'range': (0.01, 100.0)})
    corner_cut: float = field(default=5e-5, metadata={
        'doc': 'distance from a sharp corner at which the pad may pass it', 'unit': 'm',
        'range': (1e-6, 1e-2)})
    corner_settle: float = field(default=3e-4, metadata={
        'doc': 'distance before and after a sharp corner that is passed at its speed, for the '
               'lag of the robot', 'unit': 'm', 'range': (0.0, 1e-2)})
    blind_speed: float = field(default=0.05, metadata={
        'doc': 'speed to which the pad can slow down where the pad sees no further',
        'unit': 'm/s', 'range': (1e-3, 1.0)})
    unseen: float = field(default=2.0e-3, metadata={
        'doc': 'distance that the pad may go until the robot answers to a picture: the pad is '
               'slower where pictures come later, down to 30 mm/s',
        'unit': 'm', 'range': (1e-4, 1.0)})
    max_normal_speed: float = field(default=0.05, metadata={
        'doc': 'largest speed along the normal', 'unit': 'm/s', 'range': (1e-4, 1.0)})
    max_lateral_speed: float = field(default=0.1, metadata={
        'doc': 'largest speed back to the edge', 'unit': 'm/s', 'range': (1e-4, 1.0)})
    turn_gain: float = field(default=5.0, metadata={
        'doc': 'rate at which the pad is turned along the edge', 'unit': '1/s',
        'range': (0.0, 50.0)})
    max_turn_rate: float = field(default=1.5, metadata={
        'doc': 'largest rate of turn', 'unit': 'rad/s', 'range': (0.0, 20.0)})
    turn_acceleration: float = field(default=5.0, metadata={
        'doc': 'acceleration of that turn; a wrist that is asked for more than it can holds '
               'back the whole pad, off the edge at every corner',
        'unit': 'rad/s^2', 'range': (0.1, 1000.0)})
    max_turn: float = field(default=7.0, metadata={
        'doc': 'the pad is turned with the edge up to this angle from where it began, and '
               'kept beyond', 'unit': 'rad', 'range': (0.0, 100.0)})
    coast: float = field(default=0.018, metadata={
        'doc': 'how far the pad goes on straight where the ridge ends', 'unit': 'm',
        'range': (0.0, 0.1)})
    stall_time: float = field(default=5.0, metadata={
        'doc': 'the goal ends when the pad tracks, but has not come 1 mm further in this time',
        'unit': 's', 'range': (0.5, 600.0)})
    search_distance: float = field(default=0.015, metadata={
        'doc': 'how far the pad moves to where the pressure is when it shows no ridge',
        'unit': 'm', 'range': (0.0, 0.1)})
    search_speed: float = field(default=0.02, metadata={
        'doc': 'largest speed while the edge is searched', 'unit': 'm/s', 'range': (1e-3, 0.5)})
