"""The QP with rows besides the box, by OSQP: minimise ½ vᵀHv - cᵀv, lower ≤ v ≤ upper, rows·v ≤ bounds."""

from __future__ import annotations

import numpy as np
import osqp
import scipy.sparse as sparse

from rackhand.schemas.arrays import Array

# Measured on recorded sequences of such QPs: rho has to adapt soon once limits bind, scaling costs and does not help
# when the unknown is normalised, polishing prints to standard output even when told to be silent.
_SETTINGS = {
    "rho": 0.1, "adaptive_rho": 1, "adaptive_rho_interval": 10, "check_termination": 5, "eps_abs": 1e-5,
    "eps_rel": 1e-5, "max_iter": 400, "scaling": 0, "check_dualgap": False, "polishing": False,
    "warm_starting": True, "alpha": 1.6, "verbose": False,
}  # fmt: skip
_EXACT = 1e-9


class RowSolver:
    """One OSQP object for n unknowns and m rows: its sparsity never changes, values are updated in place, starts are
    warm."""

    def __init__(self, velocity: Array, m: int) -> None:
        n = len(velocity)
        self.unit = velocity  # the unknown is v / unit, within ±1, so that OSQP's tolerances mean something
        self._upper_triangle = np.array([(i, j) for j in range(n) for i in range(j + 1)]).T
        pattern = np.vstack([np.eye(n), np.ones((m, n))])
        hessian = sparse.csc_matrix(np.triu(np.ones((n, n)) + n * np.eye(n)))
        self._values = np.ones((n, m + 1))  # of the constraint matrix by columns: the 1 of the box, then the rows
        self._solver = osqp.OSQP(algebra="builtin")
        self._solver.setup(
            hessian, np.zeros(n), sparse.csc_matrix(pattern), -np.ones(n + m), np.ones(n + m), **_SETTINGS
        )
        # The documented update and solve cost 45 us a call in Python alone; the object beneath them takes the same
        # arrays.
        self._low = self._solver._solver
        self.iterations = 0  # of the last solution

    def solve(
        self, h: Array, c: Array, lower: Array, upper: Array, rows: Array, bounds: Array, safe: Array
    ) -> tuple[Array, bool]:
        """The solution, and whether it is proven optimal.

        ``safe`` (n,) is a point that holds every constraint; what OSQP leaves of violation is taken out by going
        towards it, so the answer always holds them all."""
        unit, n = self.unit, len(self.unit)
        self._values[:, 1:] = (rows * unit).T
        matrix = (h * unit * unit[:, None])[self._upper_triangle[0], self._upper_triangle[1]]
        low = np.concatenate([lower / unit, np.full(len(bounds), -1e30)])
        high = np.concatenate([upper / unit, bounds])
        ok = self._low.update_data_vec(-c * unit, low, high) == 0
        # A matrix that has lost definiteness is answered by a code here and a wrong "solved" later.
        ok = ok and self._low.update_data_mat(matrix, None, self._values.ravel(), None) == 0
        if not ok:
            return safe, False
        self._low.solve()
        self.iterations = int(self._low.info.iter)
        x, y = np.array(self._low.solution.x), np.array(self._low.solution.y)
        if not np.all(np.isfinite(x)):
            return safe, False
        exact = _polish(h, c, lower, upper, rows, bounds, y, n)
        if exact is not None:
            return exact, True
        solved = self._low.info.status_val == osqp.SolverStatus.OSQP_SOLVED
        return _hold(np.clip(x * unit, lower, upper), rows, bounds, safe), bool(solved)


def _polish(
    h: Array, c: Array, lower: Array, upper: Array, rows: Array, bounds: Array, y: Array, n: int
) -> Array | None:
    """The exact solution by an active-set search from the constraints OSQP found active; None if 20 steps do not
    prove one."""
    matrix = np.vstack([np.eye(n), -np.eye(n), rows])
    limit = np.concatenate([upper, -lower, bounds])
    active = np.concatenate([y[:n] > 1e-6, y[:n] < -1e-6, y[n:] > 1e-6])
    for _ in range(20):
        chosen = np.flatnonzero(active)
        a, size = matrix[chosen], len(chosen)
        # The tiny corner keeps dependent rows solvable.
        system = np.block([[h, a.T], [a, -1e-13 * np.eye(size)]])
        try:
            solution = np.linalg.solve(system, np.concatenate([c, limit[chosen]]))
        except np.linalg.LinAlgError:
            return None
        x, force = solution[:n], solution[n:]
        if size and force.min() < -_EXACT:
            active[chosen[force.argmin()]] = False
            continue
        violation = matrix @ x - limit
        worst = int(violation.argmax())
        if violation[worst] <= _EXACT:
            return np.clip(x, lower, upper)
        if active[worst]:
            return None
        active[worst] = True
    return None


def _hold(x: Array, rows: Array, bounds: Array, safe: Array) -> Array:
    """The last point on the way from ``safe`` to ``x`` that holds all rows."""
    start, end = rows @ safe, rows @ x
    over = end > bounds
    if not over.any():
        return x
    part = np.clip((bounds[over] - start[over]) / (end[over] - start[over]), 0.0, 1.0).min()
    held: Array = safe + part * (x - safe)
    return held
