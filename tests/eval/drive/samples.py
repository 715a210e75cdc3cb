"""Figures of missions that nobody drove."""

from hippodrome.eval.drive.scoring import DEFINITIONS

DRIVEN = {
    "missions": 10, "success_rate": 1.0, "success_rate_mapped": 1.0, "success_rate_unmapped": None, "spl": 0.9,
    "driving_score": 95.0, "collisions_at_fault": 0, "wrong_way": 0, "false_arrivals": 0, "red_lights": 0, "rights_of_way": 1,
    "outside_lane_share": 0.01, "lane_rms_m": 0.2, "lane_worst_m": 0.9, "time_ratio": 1.3, "metres_until_localized": 60.0,
    "minimum_gap_m": 2.0, "harsh_share": 0.0, "driven_km": 3.0, "per_km": {"right of way": 0.3333}, "realtime_factor": 3.0,
    "definitions": DEFINITIONS,
}  # fmt: skip
MISSION = {
    "number": 0, "seed": 5, "start": "a_0 20.0 m", "goal": "b_0 50.0 m", "end": "b_0 0.4 m from the goal", "cause": "arrived",
    "success": True, "mapped": True, "false_arrival": False, "driven_m": 300.0, "time_s": 60.0, "reference_s": 50.0, "spl": 0.9,
    "driving_score": 95.0, "events": {}, "outside_lane_share": 0.01, "lane_rms_m": 0.2, "lane_worst_m": 0.9,
    "metres_until_localized": 60.0, "minimum_gap_m": 2.0, "harsh_share": 0.0, "shortest_m": 280.0,
}  # fmt: skip


def drive_figures(**changed):
    """The ``drive`` of a row, one mission in detail."""
    return {**DRIVEN, "missions_detail": [MISSION], **changed}
