"""``hippodrome score``: a map or a trajectory against a recording's truth."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import DONE, THRESHOLD_FAILED, add_command, positive_number
from hippodrome.eval.commands.foreign import add_truth, ahead, metres_ahead, seconds


def add_score_command(commands: Any) -> None:
    """Adds ``score`` to the parser's ``commands``."""
    score = add_command(
        commands, "score", _score, "score a map or a trajectory against a recording's truth",
        """Print the absolute and relative errors (APE, RPE; metres) of a map or a trajectory, each with its definition.

        The recording may be one of ours or an imported one that came with its truth; or the truth is a file of its own, poses or
        fixes in latitude and longitude. Truth that comes more seldom than four times a second is scored at its own times. Poses
        in space are turned level before height, roll and pitch are dropped. Exit status 1: a limit was missed.""",
        ["hippodrome score out/grid/topo.pbstream out/grid/recordings/grid-mapping-*",
         "hippodrome score visual-odometry.tum recordings/kitti-07 --own-frame",
         "hippodrome score localized.tum out/grid/recordings/grid-localization-* --localization",
         "hippodrome score topo.pbstream recordings/monday --truth phone.gpx --network town.net.xml --max-ape 5"],
    )  # fmt: skip
    score.add_argument(
        "estimate", type=Path, metavar="MAP.pbstream|TRAJECTORY.tum",
        help="what is scored: a map, a TUM trajectory, or KITTI's 12 columns with --times",
    )  # fmt: skip
    score.add_argument("recording", type=Path, metavar="RECORDING", help="the recording whose truth it is held against")
    score.add_argument(
        "--own-frame", action="store_true",
        help="the trajectory has a frame and a scale of its own: align it in several ways and print the errors of each",
    )  # fmt: skip
    score.add_argument(
        "--localization", action="store_true",
        help="the trajectory is a localizer's of a second drive, in the road network's frame: print whether and when it was "
             "localized, its error from then on, and its false fixes; a ninth column, 1 or 0, says which poses it stands by "
             "(default: a mapper's trajectory; without the column: it stands by all)",
    )  # fmt: skip
    score.add_argument(
        "--axes", choices=["body", "camera"],
        help="which way poses point: body: x forward, z up; camera: z forward, y down (default: body; for 12 columns, camera)",
    )  # fmt: skip
    score.add_argument(
        "--times", type=Path, metavar="FILE", help="seconds, a line for each of KITTI's poses (default: none; KITTI's need it)"
    )
    score.add_argument(
        "--clock", choices=["auto", "source", "recording"], default="auto",
        help="the clock of the trajectory: source: that of the drive as it was imported; recording: 0 at the recording's start; "
             "auto: recording for files that hippodrome wrote, source for others (default: auto)",
    )  # fmt: skip
    score.add_argument(
        "--camera-ahead", type=metres_ahead, metavar="M",
        help="how far ahead of the rear axle the camera sits whose trajectory this is; it is then held against the axle's truth "
             "(default: it is that of the point whose truth was measured)",
    )  # fmt: skip
    score.add_argument(
        "--truth-ahead", type=ahead, default="auto", metavar="M",
        help="how far ahead of the rear axle the point lies whose poses --truth has; auto estimates it from how they slip "
             "sideways in turns (default: auto)",
    )  # fmt: skip
    add_truth(score, "the recording's own")
    score.add_argument(
        "--time-offset", type=seconds, default=0.0, metavar="S", help="seconds to add to the times of --truth (default: 0)"
    )
    score.add_argument(
        "--max-gap", type=positive_number, metavar="S",
        help="do not interpolate between samples farther apart than this, in seconds (default: 0.25; at sparse truth 1, or "
             "twice the estimate's usual interval)",
    )  # fmt: skip
    score.add_argument("--json", type=Path, metavar="FILE", help="also write the figures into this file (default: none)")
    score.add_argument(
        "--max-ape",
        type=positive_number,
        metavar="M",
        help="exit status 1 if the mean of the first APE is larger (default: no limit)",
    )
    score.add_argument(
        "--max-rpe",
        type=positive_number,
        metavar="M",
        help="exit status 1 if the mean RPE over 20 m is larger (default: no limit)",
    )


def _score(options: argparse.Namespace) -> int:
    from hippodrome.eval.exchange.score import ScoreOptions, score_files

    held = score_files(
        ScoreOptions(
            options.estimate, options.recording, not options.own_frame, options.axes, options.times, options.clock, options.truth,
            options.network, options.truth_sigma, options.time_offset, options.max_gap, options.json, options.max_ape,
            options.max_rpe, options.camera_ahead, options.truth_ahead, options.localization,
        )
    )  # fmt: skip
    return DONE if held else THRESHOLD_FAILED
