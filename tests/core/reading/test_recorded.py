"""A drive that the simulator drew is read as its road network says."""

import numpy as np
import pytest

from benchmarks.reading import MARKED_M, read_recording, scenario_of
from hippodrome.sim.record import RecordingPlan, close_renderer, record

TOWN = {"kind": "grid", "width_m": 160, "height_m": 160, "road_km": 1.0}


@pytest.fixture(scope="module")
def readings(tmp_path_factory):
    plan = RecordingPlan(scenario_of(7, TOWN, {}, length_m=160.0), "localization", tmp_path_factory.mktemp("read"))
    recording = record(plan)
    close_renderer()
    return read_recording(recording, plan.town().network)


def test_the_lane_is_read(readings):
    marked = ~readings.in_junction & (readings.to_end_m > MARKED_M)
    sees = np.array([reading.sees_lane for reading in readings.read])
    error = (readings.column("offset_m") - readings.offset_m)[marked & sees]
    assert np.sum(marked) > 20 and np.mean(sees[marked]) > 0.9
    assert np.sqrt(np.mean(error**2)) < 0.08 and abs(np.mean(error)) < 0.04
    heading = (readings.column("heading_rad") - readings.heading_rad)[marked & sees]
    assert np.sqrt(np.mean(heading**2)) < 0.03


def test_what_is_said_holds_what_it_promises(readings):
    """Wherever something is said, in junctions too, the errors are no larger than a few times what was said of them."""
    sees = np.array([reading.sees_lane for reading in readings.read])
    error = (readings.column("offset_m") - readings.offset_m)[sees]
    assert np.sqrt(np.mean(error**2)) < 0.15
    assert np.median(error**2 / readings.column("offset_variance_m2")[sees]) < 2.0
