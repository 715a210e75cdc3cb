"""The scenario's parts know of each other what they must."""

import pytest

from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.views.config import CameraGeometry
from hippodrome.sim.scenario import Scenario


def test_the_localizer_reads_the_road_with_the_scenario_s_camera():
    plain = Scenario(name="a")
    assert plain.localizer.road_reading and plain.localizer.camera == CameraGeometry()
    higher = Scenario.model_validate({"name": "a", "camera": {"height_m": 2.0, "fov_deg": 70}})
    assert higher.localizer.camera == CameraGeometry(fov_deg=70.0, height_m=2.0)


@pytest.mark.parametrize(
    "other",
    [
        {"camera": {"yaw_offset_deg": 5}},
        {"localization": {"recording": "phone"}},
        {"localizer": {"road_reading": False}},
        {"localizer": LocalizerConfig()},
    ],
)
def test_it_does_not_where_the_camera_is_askew_or_unknown_or_nobody_wants_it(other):
    assert not Scenario.model_validate({"name": "a", **other}).localizer.road_reading


def test_the_mapper_reads_the_road_where_its_drive_s_camera_is_known():
    higher = Scenario.model_validate({"name": "a", "camera": {"height_m": 2.0, "fov_deg": 70}})
    assert higher.mapper.road_reading and higher.mapper.camera == CameraGeometry(fov_deg=70.0, height_m=2.0)
    assert higher.refine.route.road_reading
    for other in ({"camera": {"yaw_offset_deg": 5}}, {"mapping": {"recording": "phone"}}, {"mapper": {"road_reading": False}}):
        assert not Scenario.model_validate({"name": "a", **other}).mapper.road_reading
    localized_elsewhere = Scenario.model_validate({"name": "a", "localization": {"recording": "phone"}})
    assert localized_elsewhere.mapper.road_reading and not localized_elsewhere.localizer.road_reading
