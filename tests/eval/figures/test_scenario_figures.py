"""The strip of the neurodynamics is drawn of localizers that have the networks, and of no other."""

from types import SimpleNamespace

import numpy as np

from hippodrome.eval.figures.scenario import _has_networks


def outcome(modules):
    estimates = [SimpleNamespace(grid_phase_rad=np.zeros((modules, 2, 2)))]
    return SimpleNamespace(localization=SimpleNamespace(estimates=estimates))


def test_a_localizer_without_grid_cells_has_no_strip():
    assert _has_networks(outcome(3))
    assert not _has_networks(outcome(0))
    assert not _has_networks(SimpleNamespace(localization=None))
