"""Drives along hand-made routes, as raw motions in map units, for the tests of the route search."""

import numpy as np

from hippodrome.core import se2
from hippodrome.core.types import Visits
from tests.core.synthetic import network_of_roads, random_route, true_path


def square_grid(columns=5, rows=5, spacing_m=100.0):
    """Straight two-way roads, all blocks alike."""
    nodes = np.array([(c, r) for r in range(rows) for c in range(columns)], dtype=float) * spacing_m
    links = [(i, i + 1, 0.0) for i in range(rows * columns) if (i + 1) % columns]
    return network_of_roads(nodes, links + [(i, i + columns, 0.0) for i in range((rows - 1) * columns)])


def visits_along(poses, units_per_metre=0.5, speed_mps=10.0, turn_noise_rad=0.0, rng=None):
    """Raw motions between consecutive poses (S, 3)."""
    motion = np.concatenate([np.zeros((1, 3)), se2.between(poses[:-1], poses[1:])])
    metres = np.hypot(motion[:, 0], motion[:, 1])
    motion[:, :2] *= np.broadcast_to(units_per_metre, len(poses))[:, None]
    if rng is not None:
        motion[1:, 2] += turn_noise_rad * rng.standard_normal(len(poses) - 1)
    return Visits(np.cumsum(metres) / speed_mps, np.arange(len(poses), dtype=np.int32), motion)


def random_drive(network, seed, length_m, **noise):
    """Visits, true poses and true lanes of a random drive."""
    rng = np.random.default_rng(seed)
    poses, lanes = true_path(network, random_route(network, rng, length_m), rng)
    return visits_along(poses, rng=rng, **noise), poses, lanes


def misplaced_m(route, poses):
    """Distance (T,) of the matched places from the true ones."""
    truth = [np.interp(route.track.arc, route.track.visit_arc, poses[:, axis]) for axis in (0, 1)]
    return np.hypot(*(route.points_m.T - np.array(truth)))
