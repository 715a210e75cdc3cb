"""Maps whose bytes are whole and whose numbers are none: refused where they enter, or by a sentence of what cannot use them."""

from dataclasses import replace

import numpy as np
import pytest
from maps import random_map

from hippodrome.core.refinement.config import RefineConfig
from hippodrome.core.refinement.refine import refine
from hippodrome.core.types import HippodromeError, StartPose
from hippodrome.proto import codec
from hippodrome.proto.codec import load_map, save_map
from hippodrome.sim.town import build_town
from hippodrome.sim.town_spec import TownSpec


def forged(path, cognitive_map, monkeypatch):
    """The map in a file, written without the checks of the writer."""
    with monkeypatch.context() as patched:
        patched.setattr(codec, "check_map", lambda _: None)
        save_map(path, cognitive_map, {})
    return path


def with_row(array, row, value):
    changed = array.copy()
    changed[row] = value
    return changed


@pytest.mark.parametrize(("change", "complaint"), [
    (lambda m: replace(m, visits=replace(m.visits, motion=with_row(m.visits.motion, 2, 1e12))),
     r"visits.motion\[2, 0\] is beyond"),
    (lambda m: replace(m, edges=replace(m.edges, motion=with_row(m.edges.motion, 1, -1e300))), r"edges.motion\[1, 0\] is beyond"),
    (lambda m: replace(m, edges=replace(m.edges, sigma=with_row(m.edges.sigma, 1, 0.0))),
     r"edges.sigma\[1, 0\] is not above zero"),
    (lambda m: replace(m, edges=replace(m.edges, sigma=with_row(m.edges.sigma, 1, 1e300))),
     r"edges.sigma\[1, 0\] is beyond 1e\+09"),
    (lambda m: replace(m, edges=replace(m.edges, sigma=with_row(m.edges.sigma, 1, 1e-300))),
     r"edges.sigma\[1, 0\] is below 1e-12"),
    (lambda m: replace(m, poses=with_row(m.poses, 1, 1e200)), r"poses\[1, 0\] is beyond"),
    (lambda m: replace(m, t_s=with_row(m.t_s, 1, 1e200)), r"t_s\[1\] is beyond"),
    (lambda m: replace(m, visits=replace(m.visits, t_s=m.visits.t_s[::-1].copy())), r"visits.t_s\[0\] is followed by an earlier"),
])  # fmt: skip
def test_numbers_that_no_vehicle_makes_are_refused(tmp_path, monkeypatch, change, complaint):
    whole = random_map()
    save_map(tmp_path / "whole", whole, {})
    with pytest.raises(HippodromeError, match=complaint):
        load_map(forged(tmp_path / "forged", change(whole), monkeypatch))
    with pytest.raises(HippodromeError, match=f"not written, the map is invalid: {complaint}"):
        save_map(tmp_path / "again", change(whole), {})


@pytest.fixture(scope="module")
def roads(tmp_path_factory):
    return build_town(
        TownSpec(kind="grid", width_m=150.0, height_m=150.0, road_km=0.9), 1, tmp_path_factory.mktemp("town")
    ).network


def driven(motion):
    """A semi-metric map of as many vertices and visits as there are motions, half a second apart."""
    count = len(motion)
    base = random_map(vertices=count, visits=count, edges=0)
    times_s = 0.5 * np.arange(count)
    visits = replace(
        base.visits, t_s=times_s, motion=np.asarray(motion, dtype=float), vertex=np.arange(count, dtype=base.visits.vertex.dtype)
    )
    return replace(base, t_s=times_s, visits=visits, poses=np.cumsum(motion, axis=0))


@pytest.mark.parametrize("mode", ["route", "paper"])
@pytest.mark.parametrize("motion", [
    np.zeros((0, 3)), np.zeros((1, 3)), np.zeros((9, 3)), np.full((2, 3), 5e-324), np.full((9, 3), 1e-300),
    np.concatenate([np.full((20, 3), [4.0, 0.0, 0.1]), [[1e9, 0.0, 0.0]]]),
])  # fmt: skip
def test_a_drive_that_is_none_is_a_sentence(roads, mode, motion):
    """Refined or refused, never a traceback and never more memory than there is."""
    try:
        refine(driven(motion), roads, RefineConfig(mode=mode), StartPose(0.0, 0.0, 0.0))
    except HippodromeError as error:
        assert "\n" not in str(error)
