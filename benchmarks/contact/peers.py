"""Methods for comparison: other libraries, Berger-Khosla, plain numpy."""

import importlib
import math

import numpy as np

from benchmarks.contact.fe_frames import DEPTH
from benchmarks.contact.golden_pictures import point_stress
from benchmarks.contact.golden_sets import PADS
from tactile_sensing.thesis.line import line_from_moments
from tactile_sensing.thesis.point_moments import closed_form
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer
from tactile_sensing.types.moments import Moments

LINE_LEVEL = 0.5  # share of the peak above which other libraries detect the line
POINT_ARRAY, LINE_ARRAY = (TactelArray(pad.rows, pad.columns, pad.pitch, pad.pitch)
                           for pad in (PADS['26x26'], PADS['16x16']))
NODES = np.array([-0.5, 0.5]) / np.sqrt(3.0) * POINT_ARRAY.pitch_x
PACKAGES = {'cv2': 'opencv-python-headless', 'skimage': 'scikit-image'}


def load():
    """Return the installed modules of other libraries, and the names of missing ones."""
    peers, missing = {}, []
    for module, package in PACKAGES.items():
        try:
            peers[module] = importlib.import_module(module)
        except ImportError:
            missing.append(package)
    if 'cv2' in peers:
        peers['cv2'].setNumThreads(1)
    return peers, missing


def _windows(images):
    """Return x, y and pressure of 9x9 tactels around the peaks, (N, 81), and the peaks' x, y."""
    n, reach = len(images), np.arange(-4, 5)
    row, column = np.divmod(images.reshape(n, -1).argmax(axis=1), POINT_ARRAY.columns)
    rows = np.clip(row, 4, 21)[:, None] + reach
    columns = np.clip(column, 4, 21)[:, None] + reach
    values = images[np.arange(n)[:, None, None], rows[:, :, None], columns[:, None, :]]
    x = np.repeat(POINT_ARRAY.x[columns][:, None, :], 9, axis=1)
    y = np.repeat(POINT_ARRAY.y[rows][:, :, None], 9, axis=2)
    return *(part.reshape(n, 81) for part in (x, y, values)), (
        POINT_ARRAY.x[column], POINT_ARRAY.y[row])


def numpy_gauss_newton(frames, *, steps=3):
    """Fit model 1 in plain numpy: 2x2 points per tactel, the whole batch, 5x5 solves."""
    x, y, values, peak = _windows(frames[:, 0])
    theta = np.column_stack([*peak, *np.zeros((3, len(x)))])
    for step in range(steps + 1):
        parameters = [value[:, None] for value in theta.T]
        corners = [(x + dx, y + dy) for dx in NODES for dy in NODES]
        jacobian = np.mean([_slopes(*at, *parameters) for at in corners], axis=0)
        model = np.mean([point_stress('zz', *at, parameters, DEPTH) for at in corners], axis=0)
        used = jacobian[..., 2:] if step == 0 else jacobian  # forces first: linear
        scale = np.sqrt((used**2).sum(axis=1))
        unit = used / scale[:, None, :]
        transposed = unit.transpose(0, 2, 1)
        change = np.linalg.solve(transposed @ unit, transposed @ (values - model)[..., None])
        theta[:, -used.shape[-1]:] += change[..., 0] / scale
    return theta


def _slopes(x, y, a, b, normal, shear_x, shear_y):
    """Return the derivatives of (2.2) by the place and the forces, (..., 5)."""
    u, v = x - a, y - b
    square = u**2 + v**2 + DEPTH**2
    kernel = 1.5 / np.pi * DEPTH**2 * square**-2.5
    force = normal * DEPTH + shear_x * u + shear_y * v
    return np.stack([
        kernel * (5.0 * force * u / square - shear_x),
        kernel * (5.0 * force * v / square - shear_y), kernel * DEPTH, kernel * u, kernel * v], -1)


def opencv_point(cv2, frame):
    """Return the point of (2.3) from OpenCV's moments of a frame."""
    [image] = frame
    pitch, column, row = POINT_ARRAY.pitch_x, *cv2.minMaxLoc(image)[3]
    found = closed_form(
        [_sensor_moments(cv2.moments(image), POINT_ARRAY)], [Layer('zz', DEPTH, image)],
        ((column - 12.5) * pitch, (row - 12.5) * pitch))
    if found.reasons:
        return [np.nan] * 5
    return [found.a, found.b, found.normal_force, found.shear_force_x, found.shear_force_y]


def opencv_line(cv2, frame, noise_std):
    """Return the line of (3.8) to (3.10), corrected, from OpenCV's thresholded moments."""
    [image] = frame
    moments = cv2.moments(np.where(image > 4.0 * noise_std, image, 0.0))
    found = line_from_moments(_sensor_moments(moments, LINE_ARRAY), LINE_ARRAY.half_width_y)
    return [found.a * np.cos(found.yaw), found.yaw, found.line_force]


def _sensor_moments(m, array):
    """Convert moments in pixels to moments about the array's centre in metres."""
    p, c = array.pitch_x, 0.5 * (array.columns - 1)
    m0, mx, my = m['m00'], m['m10'], m['m01']
    return Moments(
        m0 * p**2, (mx - c * m0) * p**3, (my - c * m0) * p**3,
        (m['m20'] - 2 * c * mx + c**2 * m0) * p**4, (m['m02'] - 2 * c * my + c**2 * m0) * p**4,
        (m['m11'] - c * (mx + my) + c**2 * m0) * p**4)


def line_points(image):
    """Return tactels above half the peak as (column, row), the input of cv2.fitLine."""
    rows, columns = np.nonzero(image > LINE_LEVEL * image.max())
    return np.column_stack([columns, rows]).astype(np.float32)


def opencv_fit_line(cv2, frame):
    """Fit a line to the tactels above half the peak with cv2.fitLine."""
    found = cv2.fitLine(line_points(frame[0]), cv2.DIST_L2, 0, 0.01, 0.01)
    vx, vy, column, row = found.ravel().tolist()
    return _through(column, row, vx, vy)


def skimage_orientation(measure, frame):
    """Return the orientation of the region above half the peak, through its weighted centroid."""
    [image] = frame
    mask = (image > LINE_LEVEL * image.max()).astype(np.uint8)
    region = measure.regionprops(mask, intensity_image=image)[0]
    row, column = region.centroid_weighted
    return _through(column, row, math.sin(region.orientation), math.cos(region.orientation))


def _through(column, row, vx, vy):
    """Return offset and yaw of the line through a tactel along (vx, vy), without force."""
    if vy < 0.0:
        vx, vy = -vx, -vy
    centre, yaw = 0.5 * (LINE_ARRAY.columns - 1), math.atan2(-vx, vy)
    offset = (column - centre) * math.cos(yaw) + (row - centre) * math.sin(yaw)
    return [offset * LINE_ARRAY.pitch_x, yaw, np.nan]


_YAWS = np.radians(np.arange(-60.0, 60.5, 1.0))
_NORMALS = np.stack([np.cos(_YAWS), np.sin(_YAWS)])
HOUGH_STEP = 0.5e-3  # accuracy of the offset that the thesis assumes [m]


def berger_khosla(frame):
    """Apply a threshold, thin to the largest tactel across the line, and Hough-transform."""
    [image] = frame
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
    # Sums over 3x3 cells, and the middle of ties: three times as accurate as one cell.
    votes = votes[:-2] + votes[1:-1] + votes[2:]
    votes = votes[:, :-2] + votes[:, 1:-1] + votes[:, 2:]
    best_rho, best_yaw = np.nonzero(votes == votes.max())
    yaw = _YAWS[best_yaw].mean()
    return [(best_rho.mean() - 40) * HOUGH_STEP, yaw, np.nan]
