"""Eqs. (10)-(12) by hand."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from hippodrome.core.solvers.pose_costs import global_residual, local_residual, total_residual


def test_eq_10_by_hand():
    poses = np.array([[1.0, 2.0, 0.5], [9.0, 9.0, 0.0], [4.0, 6.0, 0.0]])
    residual, jacobian = global_residual(poses, np.array([0, 2]), np.array([[1.0, 0.0], [1.0, 2.0]]))
    assert residual.tolist() == [0.0, 2.0, 3.0, 4.0]  # distances of 2 m and 5 m; vertex 1 is unmatched
    assert jacobian.toarray()[2].tolist() == [0, 0, 0, 0, 0, 0, 1, 0, 0]


def test_eq_11_by_hand():
    """``a`` looks north (+y); ``b`` lies 3 m ahead of it and 1 m to its left, turned by pi - 0.1 to the left."""
    poses = np.array([[10.0, 20.0, np.pi / 2], [9.0, 23.0, 3 * np.pi / 2 - 0.1]])
    motion, sigma = np.array([[2.0, 0.5, -np.pi + 0.1]]), np.array([[0.5, 0.25, 0.1]])
    residual, _ = local_residual(poses, np.array([0]), np.array([1]), motion, sigma)
    # along (3 - 2) / 0.5, across (1 - 0.5) / 0.25, heading warp(pi - 0.1 + pi - 0.1) / 0.1 = -0.2 / 0.1
    assert residual == pytest.approx([2.0, 2.0, -2.0])


def test_eq_12_by_hand():
    """Squared norms 1 + 4 and 9, weighted 2 and 0.5."""
    local = np.array([1.0, 2.0]), csr_array(np.eye(2, 3))
    on_road = np.array([3.0]), csr_array(np.array([[0.0, 0.0, 1.0]]))
    residual, jacobian = total_residual(local, on_road, 2.0, 0.5)
    assert residual @ residual == pytest.approx(2.0 * 5.0 + 0.5 * 9.0)
    assert jacobian.toarray() == pytest.approx(np.diag([np.sqrt(2.0), np.sqrt(2.0), np.sqrt(0.5)]))
