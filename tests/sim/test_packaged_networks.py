"""The networks that the SUMO package brings: each is driven, or refused with a reason that is true."""

from pathlib import Path

import numpy as np
import pytest
import sumo

from hippodrome.core.types import HippodromeError
from hippodrome.sim.drive import simulate_drive
from hippodrome.sim.ego_spec import EgoSpec
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town import build_town
from hippodrome.sim.town_spec import TownSpec
from hippodrome.sim.traffic_spec import TrafficSpec
from tests.sim.test_heights import inside_the_ego

LARGEST_BYTES = 1_000_000  # larger ones take longer to read than all the others together
ROOT = Path(sumo.SUMO_HOME)
NETWORKS = sorted(path for path in ROOT.rglob("*.net.xml*") if path.stat().st_size < LARGEST_BYTES)
LENGTH_M = 150.0


@pytest.mark.parametrize("path", NETWORKS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_each_is_driven_or_refused_with_its_reason(path, tmp_path):
    try:
        town = build_town(TownSpec(network=path), 1, tmp_path)
    except HippodromeError as error:
        said = str(error)
        assert said.startswith(f"{path}: ") and "\n" not in said
        assert "no closed loop for passenger cars" in said or "no lane is open to passenger cars" in said
        return
    drive = simulate_drive(town, TourSpec(length_m=LENGTH_M), TrafficSpec(vehicles=10), EgoSpec(), 1)
    driven_m = np.linalg.norm(np.diff(drive.poses_m[:, :2], axis=0), axis=1).sum()
    assert driven_m == pytest.approx(LENGTH_M, abs=20)
    assert inside_the_ego(drive) == 0
