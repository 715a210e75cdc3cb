"""The recogniser against maps that it cannot read."""

from dataclasses import replace

import numpy as np
import pytest

from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.localization.places import make_place_map
from hippodrome.core.localization.recogniser import PlaceRecogniser
from hippodrome.core.types import HippodromeError
from hippodrome.core.views.config import ViewCellConfig
from tests.core.looped_world import Pictures, topometric_map


@pytest.mark.parametrize("views", [ViewCellConfig(kind="grey"), ViewCellConfig(gradient_px=(64, 64))])
def test_view_cells_of_another_kind_or_shape_are_refused(views):
    config, cognitive_map = LocalizerConfig(), topometric_map(Pictures(seed=3), np.random.default_rng(3))
    places = make_place_map(cognitive_map, None, config.lane_sigma_m, config.injection.map_m)
    PlaceRecogniser(places, config)
    with pytest.raises(HippodromeError, match=r"mapper\.memory\.view_cells"):
        PlaceRecogniser(places, replace(config, views=views))
