"""Stereo pairs on disk: near the drawn ones, drawn chunk by chunk and only where they are missing."""

import numpy as np
import pytest

from hippodrome.core.types import HippodromeError
from hippodrome.eval.programs.pairs import (
    draw_pairs,
    missing_chunks,
    read_pair,
    stereo_drive,
)
from hippodrome.sim.record import RecordingPlan, close_renderer, draw_chunk, prepare
from hippodrome.sim.render.camera import CameraSpec
from hippodrome.sim.scenario import DriveSpec, Scenario
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town_spec import TownSpec
from hippodrome.sim.traffic_spec import TrafficSpec


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    camera = CameraSpec(width=96, height=72, rate_hz=10.0, stereo_baseline_m=0.5, grain=True, supersample=1)
    town = TownSpec(kind="grid", width_m=150.0, height_m=150.0, road_km=0.9)
    drive = DriveSpec(tour=TourSpec(length_m=260.0), traffic=TrafficSpec(vehicles=2))
    one = RecordingPlan(
        Scenario(name="pairs", seed=5, town=town, camera=camera, mapping=drive), "mapping", tmp_path_factory.mktemp("p")
    )
    prepare(one)
    yield one
    close_renderer()  # one per process: the next module's would be refused


def test_pairs_are_drawn_once_and_read_back_grey(plan):
    drive = stereo_drive(plan)
    chunks = missing_chunks(drive)
    assert len(chunks) >= 2
    assert missing_chunks(drive.part(0, 5)) == [0]
    draw_pairs((plan, 0))
    assert missing_chunks(drive) == chunks[1:]
    drawn = next(draw_chunk(plan, 0))
    for image, grey in zip(drawn, read_pair(drive.folder, 0), strict=True):
        luma = image @ np.array([0.299, 0.587, 0.114])
        assert grey.shape == (72, 96)
        assert np.abs(grey - luma).mean() < 4.0


def test_a_part_is_fed_with_its_own_frames_and_times(plan):
    drive = stereo_drive(plan, 8)
    if missing_chunks(drive):
        draw_pairs((plan, 0))
    part = drive.part(3, 4)
    fed = list(part.observations())
    assert [one.t_s for one in fed] == drive.times_s[3:7]
    whole = list(drive.observations())[3]
    assert (fed[0].frame == whole.frame).all()
    assert (fed[0].right == whole.right).all()
    assert (fed[0].right != fed[0].frame).any()
    assert part.duration_s == pytest.approx(0.4)


def test_a_broken_chunk_is_named(plan, tmp_path):
    with pytest.raises(HippodromeError, match=r"pairs-0000\.zip: pair 7 cannot be read"):
        read_pair(tmp_path, 7)
    (tmp_path / "pairs-0000.zip").write_bytes(b"nothing")
    with pytest.raises(HippodromeError, match="delete the file"):
        read_pair(tmp_path, 7)
