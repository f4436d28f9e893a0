"""Quadratic program of the equilibrium search, against scipy and the optimality conditions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog, nnls

from rockerbogie._kernels.solve.qp import invert, solve_qp
from support.helpers import assert_close

pytestmark = pytest.mark.nojit
SIZE, ROOM = 6, 40


def problem(rng: np.random.Generator, count: int, feasible: bool) -> tuple[np.ndarray, ...]:
    """Return B, c, n, b: a random strictly convex program with steps of some 0.1, as of a rover.

    If `feasible`, a random point meets every constraint, some of them with equality.
    """
    root = rng.normal(size=(SIZE, SIZE))
    B = root @ root.T + 0.1 * np.eye(SIZE)
    n = rng.normal(size=(count, SIZE))
    slack = 0.1 * rng.exponential(size=count) * rng.integers(2, size=count)  # some constraints are active at that point
    b = n @ rng.normal(size=SIZE) * 0.1 - slack if feasible else rng.normal(size=count) * 0.3 + 0.2
    return B, rng.normal(size=SIZE) * 0.4, n, b


def solve(B: np.ndarray, c: np.ndarray, n: np.ndarray, b: np.ndarray) -> tuple[bool, np.ndarray, np.ndarray]:
    """Return the kernel's result, step (6,) and multipliers.

    Its arrays have more room than constraints.
    """
    rows, bounds = np.full((ROOM, SIZE), np.nan), np.full(ROOM, np.nan)
    rows[: len(b)], bounds[: len(b)] = n, b
    d, force = np.full(SIZE, np.nan), np.full(ROOM, np.nan)
    solved = bool(solve_qp(np.linalg.inv(B), c, rows, bounds, len(b), d, force))
    return solved, d, force[: len(b)]


@pytest.mark.parametrize("count", [0, 1, 4, 9, 25])
@pytest.mark.parametrize("seed", range(4))
def test_step_and_multipliers_meet_the_conditions_of_an_optimum(seed: int, count: int) -> None:
    B, c, n, b = problem(np.random.default_rng([seed, count]), count, feasible=True)
    solved, d, force = solve(B, c, n, b)
    assert solved
    size = 1 + np.abs(B @ d).max() + np.abs(c).max()
    assert_close(B @ d + c, n.T @ force, 1e-9 * size, "", "the gradient is a sum of constraint normals")
    assert (n @ d >= b - 1e-12 * (1 + np.abs(b))).all()
    assert (force >= 0.0).all()
    assert_close(
        force * (n @ d - b), np.zeros(count), 1e-9 * size, "", "a force acts only on an active constraint"
    ) if count else None


@pytest.mark.parametrize("seed", range(8))
def test_step_is_that_of_scipys_least_squares(seed: int) -> None:
    """Compare with a least distance program, solved by non-negative least squares.

    It finds the point of a polyhedron that is nearest to 0.
    """
    B, c, n, b = problem(np.random.default_rng(100 + seed), 12, feasible=True)
    _, d, _ = solve(B, c, n, b)
    root = np.linalg.cholesky(B).T  # y = root d + root^-T c
    shift = np.linalg.solve(root.T, c)
    rows = np.linalg.solve(root.T, n.T).T
    bounds = b + rows @ shift
    matrix, target = np.vstack([rows.T, bounds]), np.append(np.zeros(SIZE), 1.0)
    weights, _ = nnls(matrix, target)
    residual = matrix @ weights - target
    expected = np.linalg.solve(root, -residual[:-1] / residual[-1] - shift)
    assert_close(d, expected, 1e-9, "", "one minimum, by another algorithm")


def test_constraints_that_exclude_each_other_are_refused() -> None:
    """Compare with linprog: exactly the systems without a feasible point are refused."""
    answers = []
    for seed in range(40):
        B, c, n, b = problem(np.random.default_rng(200 + seed), 10, feasible=False)
        judged = linprog(np.zeros(SIZE), A_ub=-n, b_ub=-b, bounds=(None, None))
        assert judged.status in (0, 2)
        solved, d, _ = solve(B, c, n, b)
        assert solved == (judged.status == 0)
        answers.append(solved)
        if solved:
            assert (n @ d >= b - 1e-9).all()
    assert 5 < sum(answers) < 35


def test_repeated_constraints_are_solved() -> None:
    """Several contacts of one wheel may have the same normal."""
    B, c, n, b = problem(np.random.default_rng(7), 5, feasible=True)
    _, once, _ = solve(B, c, n, b)
    solved, d, force = solve(B, c, np.tile(n, (3, 1)), np.tile(b, 3))
    assert solved
    assert_close(d, once, 1e-10, "", "the same feasible set")
    assert_close(np.tile(n, (3, 1)).T @ force, B @ d + c, 1e-8, "", "the same sum of forces")


def test_inverse_is_numpys_and_indefinite_matrices_are_refused() -> None:
    rng = np.random.default_rng(3)
    root = rng.normal(size=(SIZE, SIZE))
    A, out = root @ root.T + 0.1 * np.eye(SIZE), np.empty((SIZE, SIZE))
    assert invert(A.copy(), out)
    assert_close(out @ A, np.eye(SIZE), 1e-10, "", "the definition of an inverse")
    assert not invert(A - 2 * np.linalg.eigvalsh(A)[0] * np.eye(SIZE), out)
    assert not invert(np.full((SIZE, SIZE), np.nan), out)
