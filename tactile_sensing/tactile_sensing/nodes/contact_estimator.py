"""Contact estimator node: subscribes to tactile images, publishes contacts and wrenches."""

from typing import Any

from geometry_msgs.msg import WrenchStamped
from rclpy.qos import qos_profile_sensor_data

from tactile_common.errors import TactileError
from tactile_common.ros.cdr import unpacked
from tactile_common.ros.node import TactileNode
from tactile_common.ros.parameters import declare_from
from tactile_common.ros.runner import run
from tactile_msgs.msg import Contact as ContactMsg
from tactile_msgs.msg import TactileImage as TactileImageMsg
from tactile_sensing.compile_kernels import compile_kernels
from tactile_sensing.contact.estimator import ContactEstimator, EstimatorConfig
from tactile_sensing.conversions import contact_to_msg, contact_to_wrench, image_from_msg


class ContactEstimatorNode(TactileNode):
    """
    Estimate the contact of every tactile image.

    Subscribes to `image`. Publishes `contact` and, if its force is valid, `wrench`: the force of
    the object on the sensor. Parameters: `EstimatorConfig`.
    """

    def __init__(self, **kwargs: Any):
        super().__init__('contact_estimator', **kwargs)
        compile_kernels()
        self._estimator = ContactEstimator(declare_from(self, EstimatorConfig))
        self._contact_msg, self._wrench_msg = ContactMsg(), WrenchStamped()
        self._contact = self.create_publisher(ContactMsg, 'contact', qos_profile_sensor_data)
        self._wrench = self.create_publisher(WrenchStamped, 'wrench', qos_profile_sensor_data)
        self.create_subscription(
            TactileImageMsg, 'image', self._on_image, qos_profile_sensor_data, raw=True)

    def _on_image(self, raw: bytes) -> None:
        try:
            msg = unpacked(raw, TactileImageMsg)
        except TactileError as error:
            self._warn(f'image ignored: {error}')
            return
        try:
            image = image_from_msg(msg)
        except TactileError as error:
            self._warn(f'image {msg.sequence} is not usable: {error}')
            contact = self._estimator.refuse_malformed()
        else:
            contact = self._estimator.estimate(image)
        self._contact.publish(contact_to_msg(
            contact, msg, self.get_clock().now().nanoseconds, self._contact_msg))
        if contact.force_valid:
            self._wrench.publish(contact_to_wrench(contact, msg, self._wrench_msg))


def main(args: list[str] | None = None) -> int:
    """Run the contact estimator node."""
    return run(ContactEstimatorNode, args)
