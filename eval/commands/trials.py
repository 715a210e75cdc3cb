"""``hippodrome stress``, ``robustness`` and ``baselines``: what the chain withstands, and what it is worth."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hippodrome.eval.commands.arguments import DONE, add_out, add_workers, localizer_mode, positive, seed

MODES = ("coupled", "kalman", "lanes", "paper")  # of the localizer, see core.localizer_config.Mode


def add_trial_commands(commands: Any) -> None:
    """Adds them to the parser's ``commands``."""
    stress = commands.add_parser("stress", help="refinement under errors, over towns and seeds", description=_stress.__doc__)
    stress.add_argument("scenarios", type=Path, nargs="+", metavar="SCENARIO.yaml", help="see scenarios/")
    stress.add_argument("--seeds", type=seed, nargs="+", default=[1, 2, 3, 4, 5], metavar="N", help="default: 1 2 3 4 5")
    stress.add_argument("--case", action="append", default=[], dest="cases", metavar="NAME", help="only this case (repeatable)")
    add_workers(stress)
    add_out(stress, "out/stress")
    stress.set_defaults(command=_stress)

    robust = commands.add_parser(
        "robustness", help="localize under other light, weather, traffic and noise", description=_robustness.__doc__
    )
    robust.add_argument("scenarios", type=Path, nargs="+", metavar="SCENARIO.yaml", help="its mapping drive is mapped")
    robust.add_argument("--conditions", nargs="+", metavar="NAME", help="some of the conditions only (default: all)")
    robust.add_argument("--sequences", type=positive, default=8, metavar="N", help="unknown starts per condition (default: 8)")
    robust.add_argument("--start", type=positive, metavar="N", help="only this start of each condition: a failure, run again")
    robust.add_argument(
        "--modes",
        nargs="+",
        type=localizer_mode,
        choices=MODES,
        default=list(MODES),
        metavar="MODE",
        help=f"of {', '.join(MODES)} (default: all)",
    )
    add_workers(robust)
    add_out(robust, "out/robustness")
    robust.set_defaults(command=_robustness)

    baselines = commands.add_parser(
        "baselines", help="score the rivals on the same drive, ORB-SLAM3 among them", description=_baselines.__doc__
    )
    baselines.add_argument("scenario", type=Path, metavar="SCENARIO.yaml", help="see scenarios/")
    baselines.add_argument(
        "--runs",
        type=positive,
        default=3,
        metavar="N",
        help="of ORB-SLAM3, which varies, and one more if one crashes (default: 3)",
    )
    baselines.add_argument("--seconds", type=float, metavar="S", help="a quick look: ORB-SLAM3 only, on the first S seconds")
    baselines.add_argument(
        "--time-limit", type=positive, metavar="MIN", help="a run of ORB-SLAM3 that takes longer hangs (default: by its frames)"
    )
    baselines.add_argument("--paced", action="store_true", help="feed frames at the camera's rate, not as fast as they are taken")
    add_workers(baselines)
    add_out(baselines, "out/baselines")
    baselines.set_defaults(command=_baselines)


def _stress(options: argparse.Namespace) -> int:
    """Refine maps from real frames under noise, false closures, survey error and missing roads; a table with the worst cases."""
    from hippodrome.eval.trials.stress.run import stress

    stress(options.scenarios, options.seeds, options.cases, options.workers, options.out)
    return DONE


def _robustness(options: argparse.Namespace) -> int:
    """Map each town once, then localize from several unknown starts under each of many conditions; tables and a heat map."""
    from hippodrome.eval.trials.robustness.run import Request, robustness

    modes = list(dict.fromkeys(["coupled", *options.modes]))
    robustness(
        Request(options.scenarios, options.conditions, options.sequences, options.start, modes, options.workers, options.out)
    )
    return DONE


def _baselines(options: argparse.Namespace) -> int:
    """Evaluate a scenario, run binocular ORB-SLAM3 on both its drives and write Tables I and II with all rows; resumable."""
    from hippodrome.eval.trials.rivals.run import BaselineOptions, run_baselines

    limit_s = None if options.time_limit is None else 60.0 * options.time_limit
    wanted = options.scenario, options.out, options.runs, options.workers, options.seconds, options.paced, limit_s
    run_baselines(BaselineOptions(*wanted))
    return DONE
