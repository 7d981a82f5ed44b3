"""The fields of a contact: one order, for records, messages and compiled estimates."""
from dataclasses import astuple, fields

import numpy as np
import pytest

from tactile_msgs.msg import Contact as ContactMsg
from tactile_sensing.contact.estimator import ContactEstimator
from tactile_sensing.thesis import line
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import (
    COLUMNS,
    Contact,
    ContactType,
    PARAMETERS,
    Reason,
    RECORD,
    ROW,
)
from tactile_sensing.types.image import Layer, TactileImage

ARRAY = TactelArray(12, 14, 1e-3, 1e-3)


def test_fields_and_reasons_are_those_of_the_message():
    assert PARAMETERS == ('x', 'y', 'yaw', 'normal_force', 'shear_force_x', 'shear_force_y',
                          'line_force')
    assert ROW.x == 0 and ROW.line_force == 6
    assert COLUMNS['covariance'].metadata['doc'] == f'of ({", ".join(PARAMETERS)})'
    assert tuple(name for name in COLUMNS if name in PARAMETERS) == PARAMETERS
    assert len(ContactMsg().covariance) == len(PARAMETERS)**2
    names = {field.name for field in fields(Contact)}
    assert names <= set(ContactMsg.get_fields_and_field_types())
    assert list(COLUMNS) == list(RECORD.names)
    assert RECORD.names[:7] == ('type', 'valid', 'force_valid', 'reasons', 'x', 'y', 'yaw')
    for reason in Reason:
        assert getattr(ContactMsg, f'REASON_{reason.name}') == reason


def test_the_offset_of_a_line_is_the_same_wherever_its_point_is():
    for yaw in (0.0, 0.4, -1.2, np.pi / 2):
        across, along = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
        for at in (-0.01, 0.0, 0.02):
            x, y = 3e-3 * across + at * along
            contact = Contact(ContactType.LINE, True, Reason(0), 'fit', x=x, y=y, yaw=yaw)
            assert contact.offset == pytest.approx(3e-3, abs=1e-12)
    for yaw in (np.nan, np.inf):
        assert np.isnan(Contact(ContactType.LINE, True, Reason(0), 'fit', x=0.0, y=0.0,
                                yaw=yaw).offset)


def test_a_record_and_a_contact_say_the_same():
    picture = line.pressure(ARRAY.x, ARRAY.y[:, None], 1e-3, 0.2, 200.0, 2e-3, 60.0)
    layer = Layer('zz', 2e-3, picture, 0.0, 500.0)
    contact = ContactEstimator().estimate(TactileImage(0, 0, (layer,), ARRAY, tared=True))
    [record] = ContactEstimator().estimate_batch(picture[None], ARRAY, [layer])
    assert contact.valid and record['valid']
    for name in RECORD.names:
        value = getattr(contact, name)
        np.testing.assert_array_equal(astuple(value) if name == 'moments' else value, record[name])
