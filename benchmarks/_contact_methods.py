"""Estimators that the contact benchmark compares: ours, the thesis', and other libraries'."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
import importlib
import math

from _contact_cases import DEPTH, layers_of, LINE_ARRAY, POINT_ARRAY
import numpy as np

from tactile_sensing import point
from tactile_sensing.compensation import compensated
from tactile_sensing.line_fit import fit_line
from tactile_sensing.moments import image_moments, line_from_moments, Moments
from tactile_sensing.point_fit import fit_point, fit_points
from tactile_sensing.point_moments import basic, MomentFlag, one_layer

REFUSED = (MomentFlag.NO_FORCE | MomentFlag.SINGULAR | MomentFlag.OFF_PAD
           | MomentFlag.NOT_CONVERGED)
LINE_LEVEL = 0.5  # fraction of the peak above which other libraries see the line


@dataclass(frozen=True)
class Method:
    """
    One way to estimate a contact.

    estimate(frame) returns the parameters, NaN where it does not give one or refuses;
    batch(frames) those of many frames; peer is the module of another library.
    """

    name: str
    kind: str
    estimate: Callable | None
    batch: Callable | None = None
    peer: str = ''
    model: int = 1

    @property
    def label(self):
        """Name with the sensing structure."""
        return f'{self.name}, model {self.model}' if self.kind == 'point' else self.name

    def run(self, frames):
        """Parameters of many frames, (N, K)."""
        if self.batch:
            return self.batch(frames)
        return np.array([self.estimate(frame) for frame in frames])


def _fit_point(frame, layers):
    fit = fit_point(frame, POINT_ARRAY, layers)
    if not fit.converged:
        return [np.nan] * 5
    return [fit.a, fit.b, fit.normal_force, fit.shear_force_x, fit.shear_force_y]


def _fit_points(frames, layers):
    fit = fit_points(frames, POINT_ARRAY, layers)
    theta = np.column_stack([
        fit.a, fit.b, fit.normal_force, fit.shear_force_x, fit.shear_force_y])
    return np.where(fit.converged[:, None], theta, np.nan)


def _closed_form(frame, layers, function, **options):
    return _moment_parameters(function(frame, POINT_ARRAY, layers, **options))


def _moment_parameters(found):
    if found.flags & REFUSED:
        return [np.nan] * 5
    return [found.a, found.b, found.normal_force, found.shear_force_x, found.shear_force_y]


def _opencv_point(cv2, frame):
    image, pitch = frame[0], POINT_ARRAY.pitch_x
    m = cv2.moments(image)
    peak = cv2.minMaxLoc(image)[3]
    return _moment_parameters(one_layer(
        _sensor_moments(m, POINT_ARRAY), DEPTH,
        ((peak[0] - 12.5) * pitch, (peak[1] - 12.5) * pitch)))


def _sensor_moments(m, array):
    """Moments about the centre of the array in metres, from those in pixels."""
    p, c = array.pitch_x, 0.5 * (array.columns - 1)
    m0, mx, my = m['m00'], m['m10'], m['m01']
    return Moments(
        m0 * p**2, (mx - c * m0) * p**3, (my - c * m0) * p**3,
        (m['m20'] - 2 * c * mx + c**2 * m0) * p**4, (m['m02'] - 2 * c * my + c**2 * m0) * p**4,
        (m['m11'] - c * (mx + my) + c**2 * m0) * p**4)


def numpy_gauss_newton(frames, *, steps=3, chunk=256):
    """Model 1 as plain arrays over the batch: 9x9 tactels around the peak, 5x5 solves."""
    found = []
    reach = np.arange(-4, 5)
    for images in (frames[i:i + chunk, 0] for i in range(0, len(frames), chunk)):
        n = len(images)
        row, column = np.divmod(images.reshape(n, -1).argmax(axis=1), POINT_ARRAY.columns)
        rows = np.clip(row, 4, 21)[:, None] + reach
        columns = np.clip(column, 4, 21)[:, None] + reach
        values = images[np.arange(n)[:, None, None], rows[:, :, None], columns[:, None, :]]
        values = values.reshape(n, 81)
        x = np.repeat(POINT_ARRAY.x[columns][:, None, :], 9, axis=1).reshape(n, 81)
        y = np.repeat(POINT_ARRAY.y[rows][:, :, None], 9, axis=2).reshape(n, 81)
        theta = np.zeros((n, 5))
        theta[:, 0], theta[:, 1] = POINT_ARRAY.x[column], POINT_ARRAY.y[row]
        for step in range(steps + 1):
            parameters = [value[:, None] for value in theta.T]
            jacobian = point.stress_jacobian('zz', x, y, *parameters, DEPTH)
            model = point.stress('zz', x, y, *parameters, DEPTH)
            used = jacobian[..., 2:] if step == 0 else jacobian  # forces first: linear
            scale = np.sqrt((used**2).sum(axis=1))
            used = used / scale[:, None, :]
            normal = used.transpose(0, 2, 1) @ used
            right = used.transpose(0, 2, 1) @ (values - model)[..., None]
            theta[:, -used.shape[-1]:] += np.linalg.solve(normal, right)[..., 0] / scale
        found.append(theta)
    return np.concatenate(found)


def six_moments(frames):
    """Six moments of the whole array as one matrix product; what the closed forms start from."""
    x, y = (grid.ravel() for grid in np.meshgrid(POINT_ARRAY.x, POINT_ARRAY.y))
    basis = np.column_stack([np.ones_like(x), x, y, x * x, y * y, x * y])
    return frames.reshape(len(frames), -1) @ basis


def point_methods(noise_std, peers):
    """Every method for a point, for frames of this noise [Pa]."""
    methods = []
    for model in (1, 2, 3):
        layers = layers_of(model, noise_std)
        methods += [
            Method('fit', 'point', partial(_fit_point, layers=layers),
                   partial(_fit_points, layers=layers), model=model),
            Method('compensated', 'point', partial(
                _closed_form, layers=layers, function=compensated), model=model),
            Method('basic', 'point', partial(
                _closed_form, layers=layers, function=basic), model=model)]
        if model == 3:
            methods.append(Method('compensated as printed', 'point', partial(
                _closed_form, layers=layers, function=compensated, printed=True), model=3))
    methods.append(Method('numpy Gauss-Newton', 'point', None, numpy_gauss_newton))
    if 'cv2' in peers:
        methods.append(Method('OpenCV moments + (2.3)', 'point', partial(
            _opencv_point, peers['cv2']), peer='cv2'))
    return methods


def _fit_line(image, noise_std):
    fit = fit_line(image, LINE_ARRAY, DEPTH, noise_std)
    if not (fit.last_step < 0.05 * DEPTH and fit.line_force > 0.0):
        return [np.nan] * 3
    return [fit.rho / math.cos(fit.yaw), fit.yaw, fit.line_force]


def _line_moments(image, noise_std, printed):
    # The thesis' only preprocessing (3.5): a threshold of four times the noise.
    moments = image_moments(image, LINE_ARRAY, threshold=4.0 * noise_std)
    found = line_from_moments(moments, LINE_ARRAY.half_width_y, printed=printed)
    return [found.a, found.yaw, found.line_force]


def _opencv_line(cv2, image, noise_std):
    moments = _sensor_moments(
        cv2.moments(np.where(image > 4.0 * noise_std, image, 0.0)), LINE_ARRAY)
    found = line_from_moments(moments, LINE_ARRAY.half_width_y)
    return [found.a, found.yaw, found.line_force]


def line_points(image):
    """Tactels above half the peak as (column, row), what cv2.fitLine takes."""
    rows, columns = np.nonzero(image > LINE_LEVEL * image.max())
    return np.column_stack([columns, rows]).astype(np.float32)


def opencv_fit_line(cv2, points):
    """Direction and a point of the line, float32."""
    return cv2.fitLine(points, cv2.DIST_L2, 0, 0.01, 0.01)


def _fit_line_opencv(cv2, image):
    vx, vy, column, row = opencv_fit_line(cv2, line_points(image)).ravel().tolist()
    return _through(column, row, vx, vy)


def _skimage_orientation(measure, image):
    mask = (image > LINE_LEVEL * image.max()).astype(np.uint8)
    region = measure.regionprops(mask, intensity_image=image)[0]
    row, column = region.centroid_weighted
    return _through(column, row, math.sin(region.orientation), math.cos(region.orientation))


def _through(column, row, vx, vy):
    """Offset and yaw of the line through a tactel along (vx, vy)."""
    if vy < 0.0:
        vx, vy = -vx, -vy
    centre, pitch = 0.5 * (LINE_ARRAY.columns - 1), LINE_ARRAY.pitch_x
    slope = vx / vy if vy else math.inf
    return [(column - centre - (row - centre) * slope) * pitch, math.atan2(-vx, vy), np.nan]


_YAWS = np.radians(np.arange(-60.0, 60.5, 1.0))
_NORMALS = np.stack([np.cos(_YAWS), np.sin(_YAWS)])
HOUGH_STEP = 0.5e-3  # accuracy of the offset that the thesis assumes [m]


def _berger_khosla(image):
    """Threshold, thinning to the largest tactel across the line, Hough transform."""
    kept = image > LINE_LEVEL * image.max()
    middle = image[:, 1:-1]
    kept[:, 1:-1] &= (middle >= image[:, :-2]) & (middle >= image[:, 2:])
    kept[:, 0] &= image[:, 0] >= image[:, 1]
    kept[:, -1] &= image[:, -1] >= image[:, -2]
    rows, columns = np.nonzero(kept)
    rho = np.column_stack([LINE_ARRAY.x[columns], LINE_ARRAY.y[rows]]) @ _NORMALS
    bins = np.rint(rho / HOUGH_STEP).astype(int) + 40
    votes = np.zeros((82, len(_YAWS) + 2), dtype=int)
    np.add.at(votes, (bins + 1, np.arange(len(_YAWS)) + 1), 1)
    # Sums over 3x3 cells, and the middle of those that tie: three times nearer than one cell.
    votes = votes[:-2] + votes[1:-1] + votes[2:]
    votes = votes[:, :-2] + votes[:, 1:-1] + votes[:, 2:]
    best_rho, best_yaw = np.nonzero(votes == votes.max())
    yaw = _YAWS[best_yaw].mean()
    return [(best_rho.mean() - 40) * HOUGH_STEP / math.cos(yaw), yaw, np.nan]


def line_methods(noise_std, peers):
    """Every method for a line, for frames of this noise [Pa]."""
    methods = [
        Method('fit', 'line', partial(_fit_line, noise_std=noise_std)),
        Method('moments', 'line', partial(_line_moments, noise_std=noise_std, printed=False)),
        Method('moments as printed', 'line', partial(
            _line_moments, noise_std=noise_std, printed=True)),
        Method('Berger-Khosla', 'line', _berger_khosla)]
    if 'cv2' in peers:
        methods += [
            Method('OpenCV moments', 'line', partial(
                _opencv_line, peers['cv2'], noise_std=noise_std), peer='cv2'),
            Method('cv2.fitLine', 'line', partial(_fit_line_opencv, peers['cv2']), peer='cv2')]
    if 'skimage' in peers:
        measure = importlib.import_module('skimage.measure')
        methods.append(Method('skimage orientation', 'line', partial(
            _skimage_orientation, measure), peer='skimage'))
    return methods


def load_peers():
    """Modules of other libraries that are installed, and the names of those left out."""
    peers, missing = {}, []
    for module, package in (('cv2', 'opencv-python-headless'), ('skimage', 'scikit-image')):
        try:
            peers[module] = importlib.import_module(module)
        except ImportError:
            missing.append(package)
    if 'cv2' in peers:
        peers['cv2'].setNumThreads(1)
    return peers, missing
