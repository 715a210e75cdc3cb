"""Meanings of the keys whose declaration carries no comment, because name and unit say it all beside the code."""

from __future__ import annotations

from typing import Final

MEANINGS: Final[dict[str, str]] = {  # by model and field
    "Scenario.name": "results are filed under it: letters, digits, '.', '_', '-', at most 64",
    "Scenario.description": "for people to read; no result depends on it",
    "Scenario.seed": "seed of the generated town, the routes, the traffic, the noise of self-motion and the noise of the picture",
    "Scenario.odometry_rate_hz": "samples of self-motion a second; a whole multiple of camera.rate_hz",
    "Scenario.noise": "errors of the self-motion: the name of a level, or its figures one by one (below)",
    "TownSpec.kind": "kind of town that is generated",
    "TownSpec.width_m": "size of the town from west to east",
    "TownSpec.height_m": "size of the town from south to north",
    "TownSpec.speed_limit_mps": "speed limit of all streets; 8.33 m/s are 30 km/h",
    "CameraSpec.width": "width of a frame in pixels",
    "CameraSpec.height": "height of a frame in pixels",
    "CameraSpec.rate_hz": "frames a second",
    "CameraSpec.stereo_baseline_m": "distance of a second camera to the right of the first; null: there is one camera only",
    "TourSpec.length_m": "the drive ends after this way",
    "TourSpec.duration_s": "the drive ends after this time; with length_m given too, after whichever comes first",
    "EgoSpec.lateral_accel_mps2": "greatest lateral acceleration in bends: how fast the driver dares to turn",
    "EgoSpec.accel_mps2": "acceleration when starting off",
    "EgoSpec.decel_mps2": "deceleration when braking without need",
    "Conditions.sun_elevation_deg": "angle of the sun above the horizon",
    "Conditions.season": "season that colours meadows and trees",
    "Conditions.gain": "brightness factor of the sensor: above 1 it overexposes",
    "Conditions.gamma": "exponent of the sensor's response: above 1 shadows darken",
    "ViewCellConfig.kind": "descriptor of a view. gradient: histograms of edge directions; grey: the paper's normalized patches",
    "ExperienceMapConfig.relaxation": "how loop closures correct the map. robust: a pose graph that outvotes wrong closures; "
    "ratslam: RatSLAM's local corrections",
    "ExperienceMapConfig.closure_turn_rad": "standard deviation of a loop closure's heading",
    "AttractorConfig.mode": "paper: Eqs. (1)-(7) as printed; bounded: information never above E, and the fused belief is handed "
    "back to both populations",
    "RefineConfig.mode": "mode of hippodrome refine; hippodrome eval runs both",
    "SolverConfig.inner_iterations": "Gauss-Newton steps in each round",
    "AlignmentConfig.max_scale_m": "upper end of the scales tried, metres per map unit",
    "AlignmentConfig.turn_step_rad": "angle between two of the turns tried",
    "AlignmentConfig.icp_steps": "steps of the iterative closest points for each hypothesis and round",
    "PaperRefineConfig.max_iterations": "Gauss-Newton steps in each round",
    "PaperRefineConfig.growth_rounds": "rounds of matching and optimising at each growth step of a map that is too bent",
    "SelfMotionNoise.units_per_metre": "median of the monocular scale over drives, map units per metre",
    "SelfMotionNoise.scale_jump_every_m": "mean way between two jumps of the scale",
    "Thresholds.ape_mean_m": "the row's mean APE is at most this",
    "Thresholds.rpe_mean_m": "the row's mean RPE is at most this",
    "Thresholds.localization_error_mean_m": "the row's mean localization error is at most this",
    "Thresholds.false_fixes": "the row has at most so many false fixes",
}
