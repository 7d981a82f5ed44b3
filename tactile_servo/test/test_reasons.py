"""Reasons: the codes are those of the message, and each has one text."""

from pathlib import Path
import re

import pytest

from tactile_msgs.msg import ServoReason
from tactile_servo.reasons import GoalRefused, Reason, ReasonCode

MESSAGE = Path(__file__).resolve().parents[2] / 'tactile_msgs/msg/ServoReason.msg'


def test_names_and_numbers_are_those_of_the_message():
    told = re.findall(r'^uint16 (\w+)=(\d+)', MESSAGE.read_text(encoding='utf-8'), re.MULTILINE)
    assert {name: int(number) for name, number in told} == {
        code.name: code.value for code in ReasonCode}
    assert len(told) == len(ReasonCode)
    assert all(getattr(ServoReason, code.name) == code for code in ReasonCode)


def test_every_code_has_a_text_of_its_own():
    assert len({code.text for code in ReasonCode}) == len(ReasonCode)
    assert [code for code in ReasonCode if not code.text] == [ReasonCode.NONE]
    assert ReasonCode(200) is ReasonCode.PAUSED and ReasonCode.PAUSED == 200


@pytest.mark.parametrize('detail, text', [
    ('', 'robot does not follow'), ('joint_2', 'robot does not follow: joint_2')])
def test_particulars_stand_behind_the_text(detail, text):
    assert Reason(ReasonCode.NOT_FOLLOWING, detail).text == text


def test_a_refusal_is_an_error_with_its_reason():
    refusal = Reason(ReasonCode.BUSY)
    with pytest.raises(ValueError, match=refusal.text) as caught:
        raise GoalRefused(refusal)
    assert caught.value.reason is refusal
