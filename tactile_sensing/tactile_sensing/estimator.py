"""Contact estimation: the least model that explains a tactile image, or an honest refusal."""

from dataclasses import dataclass, field, replace

import numpy as np

from tactile_sensing.array import TactelArray
from tactile_sensing.contact import Contact, ContactType, Reason
from tactile_sensing.errors import ConfigurationError
from tactile_sensing.frame import Frame
from tactile_sensing.line_contact import fitted_line, line_by_moments
from tactile_sensing.line_fit import fit_line
from tactile_sensing.moments import image_moments
from tactile_sensing.point_contact import DETECTION, fitted_point
from tactile_sensing.point_fit import fit_point, Layer

METHODS = ('fit', 'moments')
MODELS = ('auto', 'point', 'line')
IMPOSSIBLE = 1e12  # Pa; a tactel that reports more, or no number, is not read
MIN_TACTELS = 24  # eight for each parameter of a line
LINE_LENGTH = 1.0  # standard deviation along the ridge [depths] that makes a line the first guess
CONTRADICTION = 1.5  # dB above min_snr that a second model needs to overrule a weak first
FORCE_MISMATCH = 0.1  # relative difference of the two force estimates that is told


@dataclass(frozen=True)
class EstimatorConfig:
    """How contacts are estimated."""

    method: str = field(default='fit', metadata={
        'doc': "'fit' (least squares, at the noise limit) or 'moments' (closed form of the "
               'thesis)'})
    model: str = field(default='auto', metadata={
        'doc': "'auto' (the least model that explains the image), 'point' or 'line' alone"})
    noise_std: float = field(default=0.0, metadata={
        'doc': 'standard deviation of one tactel; 0 = as the image says, or as its finest '
               'detail shows', 'unit': 'Pa', 'range': (0.0, 1e9)})
    min_snr: float = field(default=15.0, metadata={
        'doc': 'weaker contacts are reported but not valid', 'unit': 'dB',
        'range': (0.0, 100.0)})
    model_error: float = field(default=0.07, metadata={
        'doc': 'what a model may leave out, as a fraction of its pressure',
        'range': (0.0, 1.0)})
    max_chi_square: float = field(default=2.0, metadata={
        'doc': 'chi-square per degree of freedom above which a model does not explain the image',
        'range': (1.0, 1e6)})

    def __post_init__(self):
        if self.method not in METHODS:
            raise ConfigurationError(f'method: {self.method!r} is not one of {METHODS}')
        if self.model not in MODELS:
            raise ConfigurationError(f'model: {self.model!r} is not one of {MODELS}')
        for name, low, high in (('noise_std', 0.0, 1e9), ('min_snr', 0.0, 100.0),
                                ('model_error', 0.0, 1.0), ('max_chi_square', 1.0, 1e6)):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ConfigurationError(f'{name}: {value} is outside {low}..{high}')


def noise_from_image(pressure):
    """
    Noise of one tactel, from the picture alone [Pa].

    Median absolute second difference, along the axis where it is smaller: an edge is
    smooth along itself. NaN tactels are left out; NaN if nothing is left.
    """
    levels = []
    for axis in (0, 1):
        second = np.diff(pressure, n=2, axis=axis)
        finite = np.abs(second[np.isfinite(second)])
        if finite.size:
            levels.append(np.median(finite) / (0.6745 * np.sqrt(6.0)))
    return min(levels, default=np.nan)


class ContactEstimator:
    """
    Estimate the contact in one tactile image after the other; holds no state between them.

    Parameters
    ----------
    config : EstimatorConfig, optional
    """

    def __init__(self, config=None):
        self.config = config or EstimatorConfig()
        # Loads or compiles the kernels now, not under the first picture.
        array = TactelArray(8, 8, 1e-3, 1e-3)
        fit_line(np.zeros(array.shape), array, 1e-3, 1.0)
        for shear in (False, True):
            fit_point(np.zeros((1, *array.shape)), array, (Layer('zz', 1e-3, 1.0),), shear=shear)

    def estimate(self, image):
        """
        Estimate the contact of one image.

        Parameters
        ----------
        image : TactileImage

        Returns
        -------
        Contact
            Always: what cannot be estimated is not valid, with its reasons.
        """
        frame, refusal = self._condition(image)
        if refusal is not None:
            return refusal
        if self.config.method == 'moments':
            return line_by_moments(frame, self.config)
        verdict = None
        for explain in self._candidates(frame):
            contact = explain(frame, self.config)
            unclear = contact.reasons & (Reason.BAD_FIT | Reason.LOW_SNR)
            if verdict is None or Reason.LOW_SNR not in verdict.reasons:
                verdict = contact
            elif unclear and contact.snr >= self.config.min_snr + CONTRADICTION:
                # Where the likelier model is too weak, the other may contradict it, if it is
                # strong enough to, but not convince.
                verdict = replace(contact, reasons=contact.reasons | Reason.LOW_SNR)
            if not unclear:
                break
        return self._compare_forces(verdict)

    def refuse_malformed(self):
        """Return what is said of a picture that could not even be read."""
        return Contact(ContactType.NONE, False, Reason.BAD_IMAGE, self.config.method)

    def _condition(self, image):
        """Return a frame and None, or None and why there is nothing to explain."""
        method = self.config.method
        main = next((layer for layer in image.layers if layer.component == 'zz'), None)
        if main is None or any(layer.stress.shape != image.array.shape or not layer.depth > 0.0
                               for layer in image.layers):
            return None, self.refuse_malformed()
        stress = np.array([layer.stress for layer in image.layers], dtype=np.float64)
        stress[~(np.abs(stress) < IMPOSSIBLE)] = np.nan
        pressure = stress[image.layers.index(main)]
        live = int(np.count_nonzero(np.isfinite(pressure)))
        left_out = Reason(0) if image.tared else Reason.NOT_TARED
        if live < pressure.size:
            left_out |= Reason.SATURATED if image.saturated else Reason(0)
            left_out |= Reason.DEAD_TACTELS if pressure.size - live > image.saturated else 0
        if live < MIN_TACTELS:
            return None, Contact(
                ContactType.NONE, False, Reason.FEW_TACTELS | left_out, method)
        moments = image_moments(pressure, image.array)
        if not np.isfinite(moments.mxx + moments.myy):
            return None, self.refuse_malformed()
        noises = [self._noise(layer, values)
                  for layer, values in zip(image.layers, stress, strict=True)]
        noise = noises[image.layers.index(main)]
        layers = tuple(Layer(layer.component, layer.depth, std)
                       for layer, std in zip(image.layers, noises, strict=True))
        frame = Frame(pressure, stress, layers, image.array, main.depth, noise, moments,
                      left_out)
        if main.unit != 'Pa':  # no force can be told, so nothing is called a contact estimate
            kind = ContactType.OTHER if moments.m0 > 0.0 else ContactType.NONE
            return None, frame.refuse(method, kind, Reason.BAD_IMAGE)
        peak, total = np.nanmax(pressure), np.nansum(pressure)
        if peak < DETECTION * noise and total < DETECTION * noise * np.sqrt(live):
            if image.saturated:  # the loaded tactels are the ones that are missing
                return None, frame.refuse(method, ContactType.OTHER, Reason.BAD_FIT)
            return None, frame.refuse(method, ContactType.NONE, Reason.NO_CONTACT)
        return frame, None

    def _noise(self, layer, stress):
        noise = self.config.noise_std or layer.noise_std or noise_from_image(stress)
        largest = np.abs(stress[np.isfinite(stress)]).max(initial=0.0)
        # Of a noise-free picture, too, the noise is not zero.
        floor = max(1e-6 * float(largest), np.finfo(np.float32).tiny)
        return max(float(noise), floor) if np.isfinite(noise) else floor

    def _candidates(self, frame):
        """Models to try, the likelier first: how far the tactels above half the peak spread."""
        if self.config.model != 'auto':
            return [{'point': fitted_point, 'line': fitted_line}[self.config.model]]
        level = 0.5 * np.nanmax(frame.pressure)
        ridge = image_moments(frame.pressure, frame.array, threshold=level)
        along = ridge.elongation() if ridge.m0 > 0.0 else np.nan
        x, y = ridge.centre_of_pressure
        spread = (ridge.mxx + ridge.myy) / ridge.m0 - x**2 - y**2 if ridge.m0 > 0.0 else 0.0
        is_long = spread > (LINE_LENGTH * frame.depth)**2 and not along < 2.0
        return [fitted_line, fitted_point] if is_long else [fitted_point, fitted_line]

    def _compare_forces(self, contact):
        """Tell when the two estimates of the force disagree by more than noise explains."""
        if not contact.valid:
            return contact
        difference = abs(contact.force_windowed - contact.normal_force)
        allowed = FORCE_MISMATCH * contact.normal_force + 3.0 * np.sqrt(contact.covariance[3, 3])
        if difference > allowed:
            return replace(contact, reasons=contact.reasons | Reason.FORCE_MISMATCH)
        return contact
