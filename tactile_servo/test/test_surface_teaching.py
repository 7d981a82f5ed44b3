"""Features that are shown to the probe, and goals that ask for them."""
from dataclasses import replace

import numpy as np
import pytest
from test_surface_law import ARRAY, GOAL, image_of

from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.calibration import Calibration
from tactile_sensing.types.image import TactileImage
from tactile_servo.config import ServoConfig
from tactile_servo.law import Observation, Teachable
from tactile_servo.laws.registry import LAWS, make_law
from tactile_servo.laws.surface_features import PadContact
from tactile_servo.laws.surface_following import SurfaceFollowing
from tactile_servo.laws.surface_goal import Pattern
from tactile_servo.laws.surface_teaching import between
from tactile_servo.reasons import ReasonCode

SENSOR = Calibration(ARRAY, depth=0.002).sensor_info('pad', '', 0)


@pytest.fixture
def law():
    """Law that was shown a contact of 4 N beside the centre, and one of 6 N in it."""
    law = SurfaceFollowing(ServoConfig())
    law.teach('aside', image_of((3e-3, -1e-3), 4.0), ARRAY)
    law.teach('firm', image_of((0.0, 0.0), 6.0), ARRAY)
    return law


def see(law, image):
    """Show a law an image where the sensor stands in the base frame."""
    law.observe(Observation(0, 0.0, 0.0, lambda _: np.eye(4), image))
    return law.error


def test_what_was_taught_is_what_is_wanted(law):
    law.begin(replace(GOAL, features='aside'), SENSOR)
    error = see(law, image_of((3e-3, -1e-3), 4.0))
    assert (error.lateral, error.longitudinal) == pytest.approx((0.0, 0.0), abs=2e-5)
    moved = see(law, image_of((3.2e-3, -1e-3), 4.0))
    assert moved.lateral == pytest.approx(2e-4, rel=0.3)


def test_features_are_gone_through_along_the_way(law):
    law.begin(replace(GOAL, features='aside, firm'), SENSOR)
    for progress, share in ((0.0, 0.0), (0.05, 0.5), (0.1, 1.0)):
        law.assess(1.0, progress, 5.0)
        error = see(law, image_of((0.0, 0.0), 5.0))
        assert error.lateral == pytest.approx(-3e-3 * (1.0 - share), abs=2e-4)


def test_several_aims_are_interpolated():
    aims = [PadContact(force, np.full(2, force), np.zeros(3)) for force in (1.0, 3.0, 4.0)]
    for share, force in ((-1, 1.0), (0, 1.0), (0.25, 2.0), (0.5, 3.0), (0.75, 3.5), (2, 4.0)):
        aim = between(aims, share)
        assert aim.force == pytest.approx(force) and aim.place == pytest.approx([force] * 2)
    assert between(aims[:1], 0.7) is aims[0]


@pytest.mark.parametrize('goal, word', [
    ({'features': 'gently'}, "no features were taught by the name 'gently'; known: aside, firm"),
    ({'features': 'aside,,firm'}, "the name ''"),
    ({'features': 'aside', 'force': 8.0}, "'aside' are of 4.0"),
    ({'features': 'aside, firm', 'pattern': Pattern.SPIRAL, 'size': (0.02, 0.0),
      'step_over': 0.004}, 'a line, or a duration')])
def test_goals_for_features_that_cannot_be_met_are_refused(law, goal, word):
    refused = law.validate(replace(GOAL, **goal))
    assert refused is not None and word in refused.text
    assert refused.code in (ReasonCode.UNSUPPORTED_GOAL, ReasonCode.INVALID_GOAL)
    assert law.validate(replace(GOAL, features='aside')) is None
    assert law.validate(replace(GOAL, features='firm, aside, firm')) is None


def holed(image):
    """An image half of whose tactels are missing."""
    image.layers[0].stress[::2] = np.nan
    return image


@pytest.mark.parametrize('name, image, word', [
    ('', image_of((0.0, 0.0), 5.0), 'name is'), ('a, b', image_of((0.0, 0.0), 5.0), 'name is'),
    ('x' * 41, image_of((0.0, 0.0), 5.0), 'name is'),
    ('faint', image_of((0.0, 0.0), 0.2), 'feels 0.20 N, must be 0.5 N'),
    ('holed', holed(image_of((0.0, 0.0), 5.0)), 'too many tactels'),
    ('none', TactileImage(0, 0, (), ARRAY, True), 'no calibrated pressure')])
def test_what_cannot_be_taught_is_refused(law, name, image, word):
    with pytest.raises(ConfigurationError, match=word):
        law.teach(name, image, ARRAY)


def test_a_name_is_taught_again(law):
    told = law.teach('aside', image_of((2e-3, 0.0), 5.0), ARRAY)
    assert told.startswith('aside: M0 ') and 'centroid at ' in told
    law.begin(replace(GOAL, features='aside'), SENSOR)
    assert see(law, image_of((2e-3, 0.0), 5.0)).lateral == pytest.approx(0.0, abs=2e-5)


def test_laws_that_can_be_taught():
    # The node offers ~/teach for these alone.
    assert [name for name in LAWS if isinstance(make_law(name, ServoConfig()), Teachable)] == [
        'tactile_jacobian', 'jacobian_rate']
