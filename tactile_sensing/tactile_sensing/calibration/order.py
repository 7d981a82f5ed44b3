"""Find the order of rows and columns from presses in the corners and a rolling press."""

import numpy as np

from tactile_common.errors import ConfigurationError

#: Corners in the order of pressing: (row, column) of the image; 0: first, 1: last.
CORNERS = ((0, 0), (0, 1), (1, 1), (1, 0))


def seriate(activity: np.ndarray) -> np.ndarray:
    """
    Return the spatial order of lines from a rolling press; its direction is arbitrary.

    `activity` is the load on every line, (frames, lines). Lines that are loaded at the same time
    are neighbours: their order is given by the second eigenvector of the Laplacian of their
    correlations (Fiedler).
    """
    similarity = np.nan_to_num(np.corrcoef(np.sqrt(np.maximum(activity, 0.0)).T))
    similarity = np.maximum(similarity, 0.0)**2
    np.fill_diagonal(similarity, 0.0)
    degree = similarity.sum(axis=1)
    scale = 1.0 / np.sqrt(np.maximum(degree, 1e-12))
    laplacian = np.eye(len(degree)) - scale[:, None] * similarity * scale
    return np.argsort(np.linalg.eigh(laplacian)[1][:, 1] * scale)


def solve_order(corners: np.ndarray, rolling: np.ndarray | None,
                shape: tuple[int, int]) -> tuple[tuple, tuple, bool]:
    """
    Find `row_order`, `column_order` and `transposed` of `Calibration`.

    `corners` (4, raw rows, raw columns) are frames of presses in the corners of the image, in the
    order of CORNERS. `rolling` (N, raw rows, raw columns), needed if the raw lines are scrambled,
    shows a ball that is rolled all over the pad. `shape` is (rows, columns) of the image. Raises a
    ConfigurationError if the presses contradict every order.
    """
    transposed = corners.shape[1:] != tuple(shape)
    peaks = [np.unravel_index(image.argmax(), image.shape) for image in corners]
    # The first and second corner are in the same row of the image.
    same_row = abs(peaks[0][0] - peaks[1][0]) + abs(peaks[2][0] - peaks[3][0])
    same_column = abs(peaks[0][1] - peaks[1][1]) + abs(peaks[2][1] - peaks[3][1])
    if shape[0] == shape[1]:
        transposed = bool(same_column < same_row)
    if transposed:
        rolling = None if rolling is None else np.swapaxes(rolling, 1, 2)
        peaks = [peak[::-1] for peak in peaks]
    orders = []
    for axis, size in enumerate(shape):
        order = np.arange(size) if rolling is None else seriate(rolling.sum(axis=2 - axis))
        rank = np.argsort(order)
        first, last = (np.mean([rank[peak[axis]] for corner, peak in zip(
            CORNERS, peaks, strict=True) if corner[axis] == side]) for side in (0, 1))
        if abs(last - first) < 0.5 * size:
            raise ConfigurationError(
                f'corners: {("rows", "columns")[axis]} of the corners are only '
                f'{abs(last - first):.0f} of {size} apart: the order of lines is another; give a '
                'rolling press')
        orders.append(tuple((order if last > first else order[::-1]).tolist()))
    return orders[0], orders[1], transposed
