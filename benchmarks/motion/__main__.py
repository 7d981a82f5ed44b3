"""
Windows as played by a controller; solvers for the programs of `tactile_servo.motion.inverse`.

For the solvers, an arm with one joint at its limit is moved by twists. Solvers that are not
installed are left out (pip install daqp proxsuite osqp qpsolvers).
"""

from importlib.util import find_spec
from pathlib import Path
import time

import numpy as np
from scipy.optimize import lsq_linear
import scipy.sparse

from benchmarks.motion import windows
from tactile_servo.motion.inverse import damped_least_squares, hessian
from tactile_servo.motion.robot import RobotModel

ROOT = Path(__file__).resolve().parents[2]
COUNT, WARM, CHECKED = 3000, 100, 500  # all programs; not timed; compared


def programs(joints, seed=0):
    """Yield matrix, vector and bounds; successive programs are 2.5 ms of motion apart."""
    robot = RobotModel.from_urdf(ROOT / 'launch/urdf/puma260.urdf', 'tactile_pad')
    rng, count = np.random.default_rng(seed), 0
    extra = rng.normal(size=(6, joints - 6)) * 0.1  # columns of additional joints
    while count < COUNT:
        if rng.random() < 0.005 or not count:
            positions = rng.uniform(robot.lower, robot.upper)
            twist, rates = rng.normal(size=6) * np.repeat([0.03, 0.2], 3), rng.normal(size=6)
            room, held = rng.uniform(0.2, 1.5, (2, joints)), rng.integers(joints)
        positions = np.clip(positions + 0.3 * rates * 0.0025, robot.lower, robot.upper)
        jacobian = np.hstack([robot.jacobian(positions), extra])
        wanted, _ = damped_least_squares(jacobian, twist)
        lower, upper = -room[0] * np.abs(wanted).max(), room[1] * np.abs(wanted).max()
        (upper if wanted[held] > 0.0 else lower)[held] = 0.0
        matrix = hessian(np.ascontiguousarray(jacobian))
        count += 1
        yield matrix, -matrix @ wanted, lower, upper


def exact(matrix, vector, lower, upper):
    """Return the solution by bounded least squares of the root of the matrix."""
    root = np.linalg.cholesky(matrix)
    # The solver refuses empty intervals, so bounds are widened by 1e-15.
    return lsq_linear(root.T, -np.linalg.solve(root, vector), (lower - 1e-15, upper + 1e-15),
                      method='bvls', tol=1e-14, max_iter=500).x


def by_daqp(joints):
    import daqp
    no_rows, sense = np.empty((0, joints)), np.zeros(joints, np.int32)

    def solve(matrix, vector, lower, upper):
        sense[:] = 0
        solution, _, flag, _ = daqp.solve(matrix, vector, no_rows, upper, lower, sense)
        return solution if flag == 1 else None
    return solve


def by_proxsuite(joints):
    from proxsuite import proxqp
    qp = proxqp.dense.QP(joints, 0, 0, True)
    qp.settings.eps_abs, qp.settings.eps_rel = 1e-9, 0.0
    qp.settings.initial_guess = proxqp.WARM_START_WITH_PREVIOUS_RESULT
    begin = [qp.init]

    def solve(matrix, vector, lower, upper):
        begin[0](matrix, vector, None, None, None, None, None, lower, upper)
        begin[0] = qp.update
        qp.solve()
        solved = qp.results.info.status == proxqp.QPSolverOutput.PROXQP_SOLVED
        return qp.results.x.copy() if solved else None
    return solve


def by_osqp(joints):
    import osqp
    upper_part = scipy.sparse.csc_matrix(np.triu(np.ones((joints, joints))))
    places = upper_part.indices, np.repeat(np.arange(joints), np.diff(upper_part.indptr))
    solver = osqp.OSQP()
    solver.setup(upper_part + 10.0 * scipy.sparse.eye(joints, format='csc'), np.zeros(joints),
                 scipy.sparse.eye(joints, format='csc'), -np.ones(joints), np.ones(joints),
                 verbose=False, eps_abs=1e-7, eps_rel=1e-7)

    def solve(matrix, vector, lower, upper):
        solver.update(Px=matrix[places], q=vector, l=lower, u=upper)
        result = solver.solve(raise_error=False)
        return result.x if result.info.status == 'solved' else None
    return solve


def by_qpsolvers(name):
    def make(joints):
        import qpsolvers
        return lambda matrix, vector, lower, upper: qpsolvers.solve_qp(
            matrix, vector, lb=lower, ub=upper, solver=name)
    return make


SOLVERS = (('DAQP', by_daqp, ('daqp',)),
           ('DAQP by qpsolvers', by_qpsolvers('daqp'), ('daqp', 'qpsolvers')),
           ('ProxQP, warm', by_proxsuite, ('proxsuite',)),
           ('ProxQP by qpsolvers', by_qpsolvers('proxqp'), ('proxsuite', 'qpsolvers')),
           ('OSQP, warm', by_osqp, ('osqp',)))


def main():
    """Print the tables."""
    windows.main()
    print()
    print('| solver | joints | p50 [us] | p99 [us] | failed | largest deviation [rad/s] |')
    print('| --- | --- | --- | --- | --- | --- |')
    for joints in (6, 7):
        cases = list(programs(joints))
        truth = [exact(*case) for case in cases[:CHECKED]]
        for name, make, modules in SOLVERS:
            if not all(find_spec(module) for module in modules):
                continue
            solve, times, answers = make(joints), [], []
            for case in cases:
                begin = time.perf_counter()
                answers.append(solve(*case))
                times.append(time.perf_counter() - begin)
            failed = sum(answer is None for answer in answers)
            deviation = max(np.abs(answer - right).max() for answer, right in zip(
                answers, truth, strict=False)
                if answer is not None)
            p50, p99 = 1e6 * np.percentile(times[WARM:], (50, 99))
            print(f'| {name} | {joints} | {p50:.1f} | {p99:.1f} | {failed} | {deviation:.0e} |')


if __name__ == '__main__':
    main()
