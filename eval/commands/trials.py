"""``hippodrome stress``, ``robustness`` and ``baselines``: what the chain withstands, and what it is worth beside others."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import (
    DONE,
    add_command,
    add_methods,
    add_out,
    add_workers,
    localizer_mode,
    positive,
    positive_number,
    refuse_faults,
    seed,
)

# Names for --help, which does not wait for the parts that they come from: the tests hold them together.
MODES = ("coupled", "kalman", "lanes", "paper")  # those of ``core.localization.config.Mode``
CASES = (  # those of ``eval.trials.stress.cases.CASES``
    "paper", "no false closures", "false closures 5 %", "false closures 20 %", "survey error 0.5 m", "scale jumps 10 %",
    "drift x 3", "missing roads", "realistic", "harsh", "another town", "self-similar grid", "self-similar grid, start given",
)  # fmt: skip
CONDITIONS = (  # those of ``eval.trials.robustness.conditions.CONDITIONS``
    "same", "sun-opposite", "overcast", "dusk", "fog-80m", "sun-opposite-fog-80m", "winter", "traffic-0", "traffic-30",
    "camera-noise", "exposure", "blur", "wander-0.5m", "yaw-5deg", "self-motion-clean", "self-motion-realistic",
    "self-motion-harsh", "self-motion-visual",
)  # fmt: skip


def add_trial_commands(commands: Any) -> None:
    """Adds them to the parser's ``commands``."""
    stress = add_command(
        commands, "stress", _stress, "refine maps under errors, over towns and seeds",
        """Refine maps of recorded drives under errors that they may meet, one kind of error a case.

        Cases are: noisier self-motion, false loop closures, a survey error of the road network, missing roads, another town's
        network, and a town whose blocks are all alike. Writes DIR/stress.json (every row with the command that runs it again),
        DIR/stress.md (mean, percentiles and worst case of each case) and DIR/stress.png, shows all of
        it on a page, DIR/stress.html, and prints the table.""",
        ["hippodrome stress scenarios/towns/grid.yaml --seeds 1 2",
         "hippodrome stress scenarios/towns/grid.yaml --case harsh --case 'missing roads'"],
    )  # fmt: skip
    stress.add_argument(
        "scenarios", type=Path, nargs="+", metavar="SCENARIO.yaml", help="a scenario's file; its mapping drive is used"
    )
    refuse_faults(stress)
    stress.add_argument(
        "--seeds", type=seed, nargs="+", default=[1, 2, 3, 4, 5], metavar="N",
        help="seeds that replace the scenarios' own, one run each (default: 1 2 3 4 5)",
    )  # fmt: skip
    stress.add_argument(
        "--case", action="append", default=[], dest="cases", metavar="NAME",
        help="run this case only; may be given several times (default: all cases). There are: "
             + "; ".join(CASES).replace("%", "%%"),
    )  # fmt: skip
    add_methods(stress)
    add_workers(stress)
    add_out(stress, "out/stress")

    robust = add_command(
        commands, "robustness", _robustness, "localize under other light, weather, traffic and noise",
        """Map each town once, then localize in it under many conditions, from several unknown starts each.

        Each condition changes one thing: light, weather, season, traffic, the camera, or the self-motion. Place recognition
        alone, kidnapping in mid-drive, a drive in another town and the paper's ten lengths are tried too. Writes robustness.json,
        .md, .html (a page of it all), .png (a heat map) and places.png into DIR/NAME for each town and, if there are several,
        pooled into DIR, and prints the tables.""",
        ["hippodrome robustness scenarios/towns/grid.yaml",
         "hippodrome robustness scenarios/towns/grid.yaml --conditions same winter --sequences 3 --modes coupled kalman",
         "hippodrome robustness scenarios/towns/grid.yaml --conditions winter --start 5"],
    )  # fmt: skip
    robust.add_argument(
        "scenarios", type=Path, nargs="+", metavar="SCENARIO.yaml",
        help="a scenario's file; its mapping drive is mapped, its localization drive is localized under each condition",
    )  # fmt: skip
    refuse_faults(robust)
    robust.add_argument(
        "--conditions", nargs="+", metavar="NAME",
        help=f"run these conditions only (default: all of them). There are: {', '.join(CONDITIONS)}",
    )  # fmt: skip
    robust.add_argument(
        "--sequences",
        type=positive,
        default=8,
        metavar="N",
        help="unknown starts under each condition, 300 m of driving each (default: 8)",
    )
    robust.add_argument(
        "--start", type=positive, metavar="N",
        help="run this start of each condition only, as the list of failures names it; the table is printed, and only "
             "recordings and the map are written (default: all starts)",
    )  # fmt: skip
    robust.add_argument(
        "--modes", nargs="+", type=localizer_mode, choices=MODES, default=list(MODES), metavar="MODE",
        help="modes of the localizer. coupled: attractors with covariances between them, always run; the others are yardsticks: "
             "kalman: a Kalman filter; lanes: a Bayes filter on lanes; paper: the equations as printed (default: all; "
             "'default', the former name of coupled, goes on working)",
    )  # fmt: skip
    add_methods(robust)
    add_workers(robust)
    add_out(robust, "out/robustness")

    baselines = add_command(
        commands, "baselines", _baselines, "score other systems on the same drives, ORB-SLAM3 among them",
        """Evaluate a scenario as `hippodrome eval` does, and run binocular ORB-SLAM3 on both its drives beside it.

        ORB-SLAM3 is installed into an environment of its own on first use. Writes Table I (DIR/table1.md) and Table II with all
        rows, figures, and DIR/report.html; docs/baselines.md says what each system is given. What is finished is kept and read
        back by the next call.""",
        ["hippodrome baselines scenarios/towns/grid.yaml --runs 1",
         "hippodrome baselines scenarios/paper.yaml --seconds 60"],
    )  # fmt: skip
    baselines.add_argument("scenario", type=Path, metavar="SCENARIO.yaml", help="a scenario's file")
    baselines.add_argument(
        "--runs", type=positive, default=3, metavar="N",
        help="runs of ORB-SLAM3, whose results vary; one more begins if one crashes (default: 3)",
    )  # fmt: skip
    baselines.add_argument(
        "--seconds", type=positive_number, metavar="S",
        help="a quick look: run ORB-SLAM3 only, on the first S seconds of the mapping drive (default: everything, on the whole "
             "drives)",
    )  # fmt: skip
    baselines.add_argument(
        "--time-limit", type=positive, metavar="MIN",
        help="minutes after which a run of ORB-SLAM3 counts as hanging and is ended (default: by the number of its frames)",
    )  # fmt: skip
    baselines.add_argument(
        "--paced", action="store_true", help="feed frames at the camera's rate (default: as fast as ORB-SLAM3 takes them)"
    )
    add_methods(baselines)
    add_workers(baselines)
    add_out(baselines, "out/baselines")


def _stress(options: argparse.Namespace) -> int:
    from hippodrome.eval.trials.stress.run import stress

    stress(options.scenarios, options.seeds, options.cases, options.workers, options.out, options.method)
    return DONE


def _robustness(options: argparse.Namespace) -> int:
    from hippodrome.eval.trials.robustness.run import RobustnessRequest, robustness

    robustness(
        RobustnessRequest(
            scenarios=options.scenarios,
            conditions=options.conditions,
            sequences=options.sequences,
            only=options.start,
            modes=list(dict.fromkeys(["coupled", *options.modes])),
            workers=options.workers,
            out=options.out,
            methods=options.method,
        )
    )
    return DONE


def _baselines(options: argparse.Namespace) -> int:
    from hippodrome.eval.trials.rivals.run import BaselineOptions, run_baselines

    limit_s = None if options.time_limit is None else 60.0 * options.time_limit
    wanted = options.scenario, options.out, options.runs, options.workers, options.seconds, options.paced, limit_s
    run_baselines(BaselineOptions(*wanted, methods=options.method))
    return DONE
