"""Contact estimation: the least model that explains a tactile image, or an honest refusal."""

from dataclasses import dataclass, field, replace
import math

import numpy as np

from tactile_sensing.array import TactelArray
from tactile_sensing.contact import Contact, ContactType, no_covariance, Reason
from tactile_sensing.errors import ConfigurationError
from tactile_sensing.line import chord_length, peak_pressure
from tactile_sensing.line_fit import fit_line
from tactile_sensing.moments import image_moments, line_from_moments, Moments

METHODS = ('fit', 'moments')
MIN_TACTELS = 24  # eight for each parameter of a line
DETECTION = 5.0  # standard deviations of one tactel, or of the sum of all, that make a contact
MOMENTS_THRESHOLD = 4.0  # standard deviations; the thesis' threshold (3.5)
MIN_ELONGATION = 3.0  # of second moments; less is no edge, whatever the closed form says
LAST_STEP = 0.05  # fraction of the depth; the error left by a Gauss-Newton step is its square


@dataclass(frozen=True)
class EstimatorConfig:
    """How contacts are estimated."""

    method: str = field(default='fit', metadata={
        'doc': "'fit' (least squares, at the noise limit) or 'moments' (closed form of the "
               'thesis)'})
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
        # Loads or compiles the kernel now, not under the first picture.
        fit_line(np.zeros((8, 8)), TactelArray(8, 8, 1e-3, 1e-3), 1e-3, 1.0)

    def estimate(self, image):
        """
        Estimate the contact of one image from its first normal-stress layer.

        Parameters
        ----------
        image : TactileImage

        Returns
        -------
        Contact
            Always: what cannot be estimated is not valid, with its reasons.
        """
        layer = next((layer for layer in image.layers if layer.component == 'zz'), None)
        if layer is None or layer.stress.shape != image.array.shape or not layer.depth > 0.0:
            return self.refuse_malformed()
        finite = np.isfinite(layer.stress)
        pressure = np.where(finite, layer.stress, np.nan).astype(np.float64)
        live = int(np.count_nonzero(finite))
        left_out = Reason(0) if image.tared else Reason.NOT_TARED
        if live < pressure.size:
            left_out |= Reason.SATURATED if image.saturated else Reason(0)
            left_out |= Reason.DEAD_TACTELS if pressure.size - live > image.saturated else 0
        if live < MIN_TACTELS:
            return self._refuse(ContactType.NONE, Reason.FEW_TACTELS | left_out)

        moments = image_moments(pressure, image.array)
        if not np.isfinite(moments.mxx + moments.myy):
            return self.refuse_malformed()
        if layer.unit != 'Pa':  # no force can be told, so nothing is called a contact estimate
            kind = ContactType.OTHER if moments.m0 > 0.0 else ContactType.NONE
            return self._refuse(kind, Reason.BAD_IMAGE | left_out, moments)
        noise = self._noise(layer, pressure)
        peak, total = np.nanmax(pressure), np.nansum(pressure)
        if peak < DETECTION * noise and total < DETECTION * noise * np.sqrt(live):
            if image.saturated:  # the loaded tactels are the ones that are missing
                return self._refuse(ContactType.OTHER, Reason.BAD_FIT | left_out, moments)
            return self._refuse(ContactType.NONE, Reason.NO_CONTACT | left_out, moments)
        explain = self._fit if self.config.method == 'fit' else self._closed_form
        return explain(pressure, image.array, layer, noise, moments, left_out)

    def refuse_malformed(self):
        """Return what is said of a picture that could not even be read."""
        return self._refuse(ContactType.NONE, Reason.BAD_IMAGE)

    def _noise(self, layer, pressure):
        noise = self.config.noise_std or layer.noise_std or noise_from_image(pressure)
        floor = 1e-6 * np.nanmax(np.abs(pressure))  # a noise-free picture
        return max(noise, floor, np.finfo(float).tiny) if np.isfinite(noise) else floor

    def _refuse(self, kind, reasons, moments=None, **known):
        none = Moments(*[np.nan] * 6)
        return Contact(kind, False, Reason(reasons), self.config.method,
                       moments=moments or none, **known)

    def _fit(self, pressure, array, layer, noise, moments, left_out):
        depth = layer.depth
        fit = fit_line(pressure, array, depth, noise, model_error=self.config.model_error)
        finite = np.isfinite([fit.rho, fit.yaw, fit.line_force, fit.squared_error]).all()
        if not finite or fit.line_force <= 0.0:
            return self._refuse(ContactType.OTHER, Reason.BAD_FIT | left_out, moments)
        freedom = fit.used - 3
        evidence = {
            'snr': 20.0 * np.log10(peak_pressure(fit.line_force, depth) / noise),
            'residual': float(np.sqrt(fit.squared_error / freedom) / noise),
            'iterations': 3}
        if evidence['snr'] < self.config.min_snr:
            return self._refuse(ContactType.NONE, Reason.LOW_SNR | left_out, moments, **evidence)
        if fit.chi_square > self.config.max_chi_square * freedom:
            return self._refuse(ContactType.OTHER, Reason.BAD_FIT | left_out, moments, **evidence)
        cos, sin = math.cos(fit.yaw), math.sin(fit.yaw)
        if fit.last_step > LAST_STEP * depth:
            off_pad = Reason.OFF_PAD if abs(fit.rho) > array.half_width_x * cos else Reason(0)
            return self._refuse(ContactType.LINE, Reason.NOT_CONVERGED | off_pad | left_out,
                                moments, **evidence)
        line = Contact(
            ContactType.LINE, True, left_out, self.config.method, 'line/zz',
            a=fit.rho / cos, b=0.0, yaw=fit.yaw, line_force=fit.line_force,
            moments=moments, **evidence)
        # (rho, yaw, force) -> (a, yaw, line_force); more noise than expected widens it.
        change = np.array([[1.0 / cos, fit.rho * sin / cos**2, 0.0], [0, 1, 0], [0, 0, 1]])
        spread = noise**2 * max(1.0, evidence['residual']**2)
        return self._on_pad(line, array, spread * change @ np.linalg.inv(
            fit.information) @ change.T, left_out)

    def _closed_form(self, pressure, array, layer, noise, moments, left_out):
        cleaned = image_moments(pressure, array, threshold=MOMENTS_THRESHOLD * noise)
        if not cleaned.m0 > 0.0:
            return self._refuse(ContactType.NONE, Reason.LOW_SNR | left_out, moments)
        if not cleaned.elongation() >= MIN_ELONGATION:
            return self._refuse(ContactType.OTHER, Reason.BAD_FIT | left_out, moments)
        closed = line_from_moments(cleaned, array.half_width_y)
        line = Contact(
            ContactType.LINE, True, left_out, self.config.method, 'line/zz',
            a=closed.a, b=0.0, yaw=closed.yaw, line_force=closed.line_force, moments=moments,
            snr=20.0 * np.log10(peak_pressure(closed.line_force, layer.depth) / noise))
        if line.snr < self.config.min_snr:
            return self._refuse(
                ContactType.NONE, Reason.LOW_SNR | left_out, moments, snr=line.snr)
        return self._on_pad(line, array, np.full((3, 3), np.nan), left_out)

    def _on_pad(self, line, array, covariance, left_out):
        """Add force on the pad and covariance to a line; refuse one whose centre is off it."""
        half = array.half_width_x, array.half_width_y

        def chord(a, yaw):
            return chord_length(a * math.cos(yaw), yaw, *half)

        length = chord(line.a, line.yaw)
        if abs(line.a) > half[0] or length == 0.0:
            return self._refuse(
                ContactType.LINE, Reason.OFF_PAD | left_out, line.moments, snr=line.snr,
                residual=line.residual, iterations=line.iterations)
        step = 1e-6
        slopes = np.array([
            line.line_force * (chord(line.a + step, line.yaw) - length) / step,
            line.line_force * (chord(line.a, line.yaw + step) - length) / step, length])
        full = no_covariance()
        rows = [0, 2, 6]  # a, yaw, line_force in contact.PARAMETERS
        full[np.ix_(rows, rows)] = covariance
        full[3, rows] = full[rows, 3] = covariance @ slopes
        full[3, 3] = slopes @ covariance @ slopes
        return replace(line, normal_force=line.line_force * length, covariance=full)
