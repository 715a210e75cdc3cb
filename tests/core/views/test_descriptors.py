"""Descriptors: small, of a declared shape, the same for frames of any size."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from hippodrome.core.views.config import ViewCellConfig
from hippodrome.core.views.descriptors import describe
from tests.core.views.skyline import panorama

KINDS = ["gradient", "grey"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_template_is_small_and_its_shape_is_declared(kind):
    config = ViewCellConfig(kind=kind)
    descriptor = describe(np.zeros((120, 160, 3), dtype=np.uint8), config)
    assert descriptor.shape == (np.prod(config.shape),)
    assert descriptor.nbytes <= 1024


@pytest.mark.parametrize("kind", KINDS)
def test_frames_of_other_sizes_and_grey_frames_give_nearly_the_same_template(kind):
    config = ViewCellConfig(kind=kind)
    small = np.repeat(panorama(3)[:, :160, None], 3, axis=2)
    large = small.repeat(4, axis=0).repeat(4, axis=1)
    assert_array_equal(describe(small[..., 0], config), describe(small, config))
    assert np.corrcoef(describe(small, config), describe(large, config))[0, 1] > 0.98


@pytest.mark.parametrize("wrong", [{"top": 0.8}, {"cell_px": 5}, {"bins": 1}, {"gradient_shift": -1}])
def test_impossible_settings_are_rejected(wrong):
    with pytest.raises(ValueError, match="view cells"):
        ViewCellConfig(**wrong)
