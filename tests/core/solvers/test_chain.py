import numpy as np
import pytest

from hippodrome.core.solvers.chain import (
    ChainSystem,
    factorise,
    marginals,
    multiply,
    solve,
    solve_coupled,
)

BLOCKS, SIZE, BORDER = 40, 4, 2


@pytest.fixture
def system():
    rng = np.random.default_rng(0)
    root = rng.standard_normal((BLOCKS * SIZE + BORDER, BLOCKS * SIZE + BORDER))
    dense = root @ root.T + len(root) * np.eye(len(root))
    blocks = dense[:-BORDER, :-BORDER].reshape(BLOCKS, SIZE, BLOCKS, SIZE)
    diagonal = np.array([blocks[i, :, i] for i in range(BLOCKS)])
    upper = 0.5 * np.array([blocks[i, :, i + 1] for i in range(BLOCKS - 1)])
    border = dense[:-BORDER, -BORDER:].reshape(BLOCKS, SIZE, BORDER)
    return ChainSystem(
        diagonal, upper, border, dense[-BORDER:, -BORDER:], rng.standard_normal((BLOCKS, SIZE)), rng.standard_normal(2)
    )


def dense_of(system):
    full = np.zeros((BLOCKS, SIZE, BLOCKS, SIZE))
    for i in range(BLOCKS):
        full[i, :, i] = system.diagonal[i]
    for i in range(BLOCKS - 1):
        full[i, :, i + 1], full[i + 1, :, i] = system.upper[i], system.upper[i].T
    matrix = full.reshape(BLOCKS * SIZE, -1)
    border = system.border.reshape(-1, BORDER)
    return np.block([[matrix, border], [border.T, system.corner]])


def flat(x, border):
    return np.concatenate([x.ravel(), border])


def test_the_direct_solution_is_numpys(system):
    expected = np.linalg.solve(dense_of(system), flat(system.rhs, system.rhs_border))
    np.testing.assert_allclose(flat(*solve(factorise(system), system.rhs, system.rhs_border)), expected, rtol=1e-9)


def test_marginals_are_blocks_of_the_inverse(system):
    inverse = np.linalg.inv(dense_of(system))[:-BORDER, :-BORDER].reshape(BLOCKS, SIZE, BLOCKS, SIZE)
    own, next_ = marginals(factorise(system))
    np.testing.assert_allclose(own, [inverse[i, :, i] for i in range(BLOCKS)], rtol=1e-8)
    np.testing.assert_allclose(next_, [inverse[i, :, i + 1] for i in range(BLOCKS - 1)], rtol=1e-6, atol=1e-12)


def test_the_product_is_numpys(system):
    rng = np.random.default_rng(1)
    x, border = rng.standard_normal((BLOCKS, SIZE)), rng.standard_normal(BORDER)
    np.testing.assert_allclose(flat(*multiply(system, x, border)), dense_of(system) @ flat(x, border), rtol=1e-10)


def test_distant_couplings_are_solved_to_the_tolerance(system):
    rng = np.random.default_rng(2)
    factors = [(3, 30, rng.standard_normal((3, 2 * SIZE))), (10, 38, 5.0 * rng.standard_normal((3, 2 * SIZE)))]
    extra = np.zeros((BLOCKS * SIZE + BORDER,) * 2)
    for a, b, jacobian in factors:
        index = np.r_[a * SIZE : (a + 1) * SIZE, b * SIZE : (b + 1) * SIZE]
        extra[np.ix_(index, index)] += jacobian.T @ jacobian

    def couple(x):
        return (extra[:-BORDER, :-BORDER] @ x.ravel()).reshape(x.shape)

    expected = np.linalg.solve(dense_of(system) + extra, flat(system.rhs, system.rhs_border))
    x, border, _ = solve_coupled(system, couple, 1e-10, 100)
    np.testing.assert_allclose(flat(x, border), expected, rtol=1e-7, atol=1e-12)


def test_the_recursions_by_hand():
    """T = [[2, 1], [1, 2]], its border not coupled: pivots 2 and 2 - 1 / 2, gain 1 / 2, inverse [[2, -1], [-1, 2]] / 3."""
    blocks = np.full((2, 1, 1), 2.0), np.ones((1, 1, 1))
    system = ChainSystem(*blocks, np.zeros((2, 1, 1)), np.ones((1, 1)), np.array([[3.0], [0.0]]), np.array([5.0]))
    factor = factorise(system)
    assert factor.inverse_pivot.ravel() == pytest.approx([1.0 / 2.0, 1.0 / 1.5])
    assert factor.gain.ravel() == pytest.approx([0.5])
    assert flat(*solve(factor, system.rhs, system.rhs_border)) == pytest.approx([2.0, -1.0, 5.0])
    own, next_ = marginals(factor)
    assert own.ravel() == pytest.approx([2.0 / 3.0, 2.0 / 3.0])
    assert next_.ravel() == pytest.approx([-1.0 / 3.0])
