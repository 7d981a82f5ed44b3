"""The fields of a contact: one order, for records, messages and compiled estimates."""
from dataclasses import astuple, fields

import numpy as np
import pytest

from tactile_msgs.msg import Contact as ContactMsg
from tactile_sensing.contact.estimator import ContactEstimator
from tactile_sensing.half_space import line
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import (
    COLUMNS,
    Contact,
    ESTIMATE,
    PARAMETERS,
    REALS,
    RECORD,
    ROW,
)
from tactile_sensing.types.image import Layer, TactileImage

ARRAY = TactelArray(12, 14, 1e-3, 1e-3)


def test_rows_of_the_covariance_are_those_of_the_message():
    assert PARAMETERS == ('a', 'b', 'yaw', 'normal_force', 'shear_force_x', 'shear_force_y',
                          'line_force')
    assert ROW.a == 0 and ROW.line_force == 6
    assert COLUMNS['covariance'].metadata['doc'] == f'of ({", ".join(PARAMETERS)})'
    assert tuple(name for name in COLUMNS if name in PARAMETERS) == PARAMETERS
    assert len(ContactMsg().covariance) == len(PARAMETERS)**2


def test_messages_and_estimates_have_every_field():
    told = {field.name for field in fields(Contact)}
    assert told <= set(ContactMsg.get_fields_and_field_types())
    assert set(REALS) <= set(ESTIMATE.names)
    assert list(COLUMNS) == list(RECORD.names)


@pytest.mark.parametrize('name', [name for name in RECORD.names if name not in ('type', 'valid')])
def test_a_record_and_a_contact_say_the_same(name):
    picture = line.stress_with_shear(ARRAY.x, ARRAY.y[:, None], 1e-3, 0.2, 200.0, 60.0, 2e-3)
    layer = Layer('zz', 2e-3, picture, 0.0, 500.0)
    contact = ContactEstimator().estimate(TactileImage(0, 0, (layer,), ARRAY, tared=True))
    [record] = ContactEstimator().estimate_batch(picture[None], ARRAY, [layer])
    assert contact.valid and record['valid'] and contact.type == record['type']
    value = getattr(contact, name)
    np.testing.assert_array_equal(astuple(value) if name == 'moments' else value, record[name])
