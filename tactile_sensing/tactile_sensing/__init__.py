"""
Tactile arrays: devices, calibration and contact estimation.

A ball presses onto an array of 16 x 16 tactels, 2 mm below the skin's surface:

>>> import numpy as np
>>> from tactile_sensing import (
...     ContactEstimator, EstimatorConfig, Layer, TactelArray, TactileImage)
>>> array, depth = TactelArray(rows=16, columns=16, pitch_x=1.6e-3, pitch_y=1.6e-3), 2e-3
>>> away = np.hypot(array.x - 1e-3, array.y[:, None] + 2e-3)  # from the contact [m]
>>> force = 5.0  # N; pressure by Boussinesq
>>> pressure = 1.5 / np.pi * force * depth**3 / (away**2 + depth**2)**2.5
>>> pressure += np.random.default_rng(0).normal(0.0, 500.0, pressure.shape)  # Pa
>>> estimator = ContactEstimator(EstimatorConfig(tactel='point'))  # not the mean over tactels
>>> contact = estimator.estimate(
...     TactileImage(0, 0, (Layer('zz', depth, pressure),), array, tared=True))
>>> contact.type.name, contact.valid
('POINT', True)
>>> [f'{1e3 * it:.1f} mm' for it in (contact.x, contact.y)], f'{contact.normal_force:.1f} N'
(['1.0 mm', '-2.0 mm'], '5.0 N')
"""
from tactile_common.exports import exported

__all__, __getattr__, __dir__ = exported(__name__, {
    'contact.estimator': 'ContactEstimator EstimatorConfig',
    'contact.ridge': 'ridge_points',
    'devices.calibration': 'Calibration load_calibration',
    'devices.recording': 'Recording load_recording',
    'devices.stream': 'open_sensor',
    'image': 'image_moments',
    'skin.pressure': 'SkinPressure',
    'types.array': 'TactelArray',
    'types.contact': 'Contact ContactType Reason',
    'types.image': 'Layer SensorInfo TactileImage',
    'types.moments': 'Moments',
    'types.skin': 'Skin',
})
