"""Models of the probe without a servo: tables of Jacobians, and the finite elements."""
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
import resource
import time

import numpy as np

from tactile_sensing.dome.finite_elements import (
    FiniteElementDome,
    operator_for,
    SkinConfig,
    solve,
)
from tactile_sensing.dome.geometry import Dome, HalfSpaceDome
from tactile_sensing.types.array import TactelArray
from tactile_servo.tactile_jacobian import (
    build_table,
    FeatureKind,
    grid,
    Increments,
    JacobianTable,
    loading_cases,
    ModelFeatures,
)
from tactile_simulation.sensor import Sensor

DOME, SKIN = Dome(), SkinConfig()
ACROSS = (9, 15, 20, 25, 30)  # elements, in four layers
TABLES = (2, 4, 6, 12)  # contacts along each side of the pad
FORCES = np.array([1.0, 2.0, 3.5, 5.0, 7.5, 10.0])  # N, of a table
STATES = 400  # number of test contacts for the tables
STEP = 5e-4  # m, displacement of a contact
STIFFNESS = 15600.0  # N/m


def array() -> TactelArray:
    """Return the array of the scenes."""
    return Sensor().array


def resolution() -> list[dict]:
    """
    Return the error of the step that a table's Jacobian derives from a small displacement.

    The contacts are anywhere within 9 mm at 2 to 8 N and are moved by `STEP`; the images come from
    the elements. The tables are those of the half-space, as in the servo, and of the elements.
    Also returns the cost of each table.
    """
    tactels = array()
    elements = FiniteElementDome(DOME, tactels, operator_for(DOME, SKIN, tactels))
    models = {'half-space': HalfSpaceDome(DOME, tactels), 'elements': elements}
    rng, rows = np.random.default_rng(0), []
    places = rng.uniform(-9e-3, 9e-3, (STATES, 2))
    states = np.column_stack([places, rng.uniform(2.0, 8.0, STATES)])
    angles = rng.uniform(0.0, 2.0 * np.pi, STATES)
    moves = STEP * np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
    for kind in FeatureKind:
        truth = ModelFeatures(elements, tactels, kind)
        shown = [(truth(state), truth(state + move))
                 for state, move in zip(states, moves, strict=True)]
        for name, model in models.items():
            features = ModelFeatures(model, tactels, kind)
            for across in TABLES:
                begin = time.process_time()
                table = build_table(
                    features, kind, grid(tactels.half_width_x, tactels.half_width_y, across,
                                         FORCES), Increments(stiffness=STIFFNESS),
                    tactels.half_width_x)
                built = time.process_time() - begin
                rows.append({'features': kind.value, 'model': name, 'across': across,
                             **_tried(table, shown, moves), 'built': built,
                             'usable': float(table.usable.mean())})
    return rows


def _tried(table: JacobianTable, shown, moves):
    begin = time.process_time()
    inverses = [table.nearest(before) for before, _ in shown]
    seconds = time.process_time() - begin
    steps = np.array([inverse @ (after - before)
                      for inverse, (before, after) in zip(inverses, shown, strict=True)])
    off = np.linalg.norm((steps - moves)[:, :2], axis=1) / STEP
    return {'median': float(np.median(off)), 'p95': float(np.percentile(off, 95)),
            'lookup': seconds / len(shown)}


def jacobians() -> list[dict]:
    """Return the largest difference of the least-squares Jacobian from differences on the pad."""
    tactels, rows = array(), []
    increments = Increments(place=1e-4, force=0.01, stiffness=STIFFNESS)
    elements = FiniteElementDome(DOME, tactels, operator_for(DOME, SKIN, tactels))
    for kind in FeatureKind:
        for name, model in (('half-space, differences', HalfSpaceDome(DOME, tactels)),
                            ('elements, differences', elements)):
            features, worst = ModelFeatures(model, tactels, kind), 0.0
            for contact in grid(tactels.half_width_x, tactels.half_width_y, 6, [5.0]):
                by_cases = np.linalg.lstsq(*loading_cases(features, contact, increments),
                                           rcond=None)[0].T
                other = _differences(features, contact) * [1.0, 1.0, STIFFNESS]
                off = np.linalg.norm(by_cases - other, axis=1) / np.linalg.norm(other, axis=1)
                worst = max(worst, float(off.max()))
            rows.append({'features': kind.value, 'against': name, 'largest': worst})
    return rows


def _differences(features, contact):
    """Return central differences (3, 3) of features (3,) by a contact."""
    return np.array([(features(contact + step) - features(contact - step)) / (2.0 * step.sum())
                     for step in np.diag([1e-4, 1e-4, 1e-2])]).T


def elements() -> list[dict]:
    """Return time and memory to solve the skin, and the force on the array, by elements."""
    rows = []
    for across in ACROSS:
        # Each case runs in a separate process, whose peak memory is measured.
        with ProcessPoolExecutor(1, mp_context=get_context('spawn')) as alone:
            rows.append(alone.submit(_solved, across).result())
    for row in rows:
        row['force'] = row['force'] / rows[-1]['force'] - 1.0
    return rows


def _solved(across):
    tactels = array()
    begin = time.process_time()
    operator = solve(DOME, SkinConfig(across=across), tactels)
    seconds = time.process_time() - begin
    model = FiniteElementDome(DOME, tactels, operator)
    state = np.array([0.0, 0.0, 5.0, 0.0, 0.0])
    image = model.image(state)
    begin = time.process_time()
    kind = FeatureKind.MOMENTS
    build_table(ModelFeatures(model, tactels, kind), kind,
                grid(tactels.half_width_x, tactels.half_width_y, 6, [5.0]), Increments(),
                tactels.half_width_x)
    return {'elements': across**2 * SkinConfig().layers, 'solve': seconds,
            'memory': 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
            'table': time.process_time() - begin,
            'force': float(image.sum() * tactels.pitch_x * tactels.pitch_y)}


def cached_start() -> float:
    """Return the processor time to load the solved skin from disk [s]."""
    tactels = array()
    operator_for(DOME, SKIN, tactels)
    begin = time.process_time()
    operator_for(DOME, SKIN, tactels)
    return time.process_time() - begin
