"""The command line. Exit status: 0 done, 1 a threshold failed, 2 bad input, 130 interrupted."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from hippodrome.core.types import HippodromeError, StartPose
from hippodrome.eval.authoring.command import add_scenario_command
from hippodrome.eval.gate.command import add_gate_command

DONE, THRESHOLD_FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

EPILOG = """\
examples:
  hippodrome scenario new my-town --from my_town.net.xml
  hippodrome eval scenarios/towns/rural.yaml --out out/rural
  hippodrome eval scenarios/paper.yaml --network my_town.net.xml --seed 7
  hippodrome render scenarios/towns/grid.yaml --out out/grid
  hippodrome map out/grid/recordings/grid-mapping-* --out out/grid/semi.pbstream
  hippodrome refine out/grid/semi.pbstream --network out/grid/towns/*.net.xml --out out/grid/topo.pbstream
  hippodrome localize out/grid/topo.pbstream out/grid/recordings/grid-localization-* --out out/grid/drive.tum

exit status: 0 done, 1 a threshold of the scenario failed, 2 bad input (nothing is overwritten), 130 interrupted (rerun to resume)
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of the command ``hippodrome``."""
    options = _parser().parse_args(arguments)
    command: Callable[[argparse.Namespace], int] = options.command
    try:
        return command(options)
    except HippodromeError as error:
        print(f"hippodrome: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("hippodrome: interrupted; what was finished is kept, the same command resumes", file=sys.stderr)
        return INTERRUPTED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="hippodrome",
        description="Builds, refines, localizes in and scores topometric cognitive maps of simulated drives.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    evaluate = commands.add_parser("eval", help="run scenarios end to end and score them", description=_evaluate.__doc__)
    _scenario_options(evaluate, several=True)
    evaluate.add_argument(
        "--workers", type=_positive, default=os.cpu_count() or 1, metavar="N", help="processes (default: all cores)"
    )
    evaluate.add_argument("--out", type=Path, default=Path("out/eval"), metavar="DIR", help="results go here (default: out/eval)")
    evaluate.set_defaults(command=_evaluate)

    add_scenario_command(commands)
    add_gate_command(commands)

    render = commands.add_parser("render", help="make the recordings of a scenario only", description=_render.__doc__)
    _scenario_options(render, several=False)
    render.add_argument(
        "--workers", type=_positive, default=os.cpu_count() or 1, metavar="N", help="processes (default: all cores)"
    )
    render.add_argument(
        "--out", type=Path, default=Path("out/render"), metavar="DIR", help="recordings go here (default: out/render)"
    )
    render.set_defaults(command=_render)

    report = commands.add_parser("report", help="write DIR/report.html anew", description=_report.__doc__)
    report.add_argument("results", type=Path, metavar="DIR", help="folder with results.json")
    report.set_defaults(command=_report)

    under_stress = commands.add_parser(
        "stress", help="refinement under errors, over towns and seeds", description=_stress.__doc__
    )
    under_stress.add_argument("scenarios", type=Path, nargs="+", metavar="SCENARIO.yaml", help="see scenarios/")
    under_stress.add_argument("--seeds", type=_seed, nargs="+", default=[1, 2, 3, 4, 5], metavar="N", help="default: 1 2 3 4 5")
    under_stress.add_argument(
        "--case", action="append", default=[], dest="cases", metavar="NAME", help="only this case (repeatable)"
    )
    under_stress.add_argument(
        "--workers", type=_positive, default=os.cpu_count() or 1, metavar="N", help="processes (default: all cores)"
    )
    under_stress.add_argument("--out", type=Path, default=Path("out/stress"), metavar="DIR", help="default: out/stress")
    under_stress.set_defaults(command=_stress)

    build = commands.add_parser("map", help="build the semi-metric map of a recording", description=_map.__doc__)
    build.add_argument("recording", type=Path, metavar="RECORDING", help="folder of a recording")
    build.add_argument("--scenario", type=Path, metavar="SCENARIO.yaml", help="take the mapper's settings from this scenario")
    build.add_argument("--out", type=Path, required=True, metavar="MAP.pbstream")
    build.set_defaults(command=_map)

    refine = commands.add_parser("refine", help="turn a semi-metric map topometric", description=_refine.__doc__)
    refine.add_argument("map", type=Path, metavar="MAP.pbstream")
    refine.add_argument("--network", type=Path, required=True, metavar="NET.net.xml[.gz]")
    refine.add_argument(
        "--mode", choices=["default", "paper"], default="default", help="default: unknown start; paper: Eqs. (8)-(12)"
    )
    refine.add_argument(
        "--start", type=_start_pose, metavar="X,Y,HEADING", help="known start: metres, degrees (mode paper needs it)"
    )
    refine.add_argument(
        "--scenario", type=Path, metavar="SCENARIO.yaml", help="take the refinement's settings from this scenario"
    )
    refine.add_argument("--out", type=Path, required=True, metavar="MAP.pbstream")
    refine.set_defaults(command=_refine)

    localize = commands.add_parser(
        "localize", help="localize a recorded drive in a topometric map", description=_localize.__doc__
    )
    localize.add_argument("map", type=Path, metavar="MAP.pbstream")
    localize.add_argument("recording", type=Path, metavar="RECORDING", help="folder of a recording")
    localize.add_argument("--network", type=Path, metavar="NET.net.xml[.gz]", help="lanes to pull the estimate to")
    localize.add_argument(
        "--scenario", type=Path, metavar="SCENARIO.yaml", help="take the localizer's settings from this scenario"
    )
    localize.add_argument("--out", type=Path, required=True, metavar="TRAJECTORY.tum")
    localize.set_defaults(command=_localize)

    robust = commands.add_parser(
        "robustness", help="localize under other light, weather, traffic and noise", description=_robustness.__doc__
    )
    robust.add_argument("scenario", type=Path, metavar="SCENARIO.yaml", help="its mapping drive is mapped")
    robust.add_argument("--conditions", nargs="+", metavar="NAME", help="some of the conditions only (default: all)")
    robust.add_argument("--sequences", type=_positive, default=8, metavar="N", help="unknown starts per condition (default: 8)")
    robust.add_argument(
        "--workers", type=_positive, default=os.cpu_count() or 1, metavar="N", help="processes (default: all cores)"
    )
    robust.add_argument("--out", type=Path, default=Path("out/robustness"), metavar="DIR", help="default: out/robustness")
    robust.set_defaults(command=_robustness)

    baselines = commands.add_parser(
        "baselines", help="score the rivals on the same drive, ORB-SLAM3 among them", description=_baselines.__doc__
    )
    baselines.add_argument("scenario", type=Path, metavar="SCENARIO.yaml", help="see scenarios/")
    baselines.add_argument("--runs", type=_positive, default=3, metavar="N", help="of ORB-SLAM3, which varies (default: 3)")
    baselines.add_argument("--seconds", type=float, metavar="S", help="a quick look: ORB-SLAM3 only, on the first S seconds")
    baselines.add_argument("--paced", action="store_true", help="feed frames at the camera's rate, not as fast as they are taken")
    baselines.add_argument("--workers", type=_positive, default=os.cpu_count() or 1, metavar="N", help="processes that render")
    baselines.add_argument("--out", type=Path, default=Path("out/baselines"), metavar="DIR", help="default: out/baselines")
    baselines.set_defaults(command=_baselines)
    return parser


def _scenario_options(parser: argparse.ArgumentParser, several: bool) -> None:
    parser.add_argument("scenarios", type=Path, nargs="+" if several else 1, metavar="SCENARIO.yaml", help="see scenarios/")
    parser.add_argument("--network", type=Path, metavar="NET", help="drive in this SUMO network (.net.xml, .net.xml.gz) instead")
    parser.add_argument("--seed", type=_seed, metavar="N", help="replace the scenario's seed")


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is less than 1")
    return value


def _seed(text: str) -> int:
    value = int(text)
    if not 0 <= value < 2**31:
        raise argparse.ArgumentTypeError(f"{value} is not between 0 and 2147483647")
    return value


def _start_pose(text: str) -> StartPose:
    import math

    try:
        x_m, y_m, heading_deg = (float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not X,Y,HEADING (metres, metres, degrees)") from None
    return StartPose(x_m, y_m, math.radians(heading_deg))


def _evaluate(options: argparse.Namespace) -> int:
    """Drive, render, map, refine, localize and score each scenario; writes DIR/results.json, tables and figures."""
    from hippodrome.eval.run import evaluate

    return DONE if evaluate(options.scenarios, options.network, options.seed, options.workers, options.out) else THRESHOLD_FAILED


def _render(options: argparse.Namespace) -> int:
    """Simulate and draw the mapping and the localization drive of one scenario, without evaluating them."""
    from hippodrome.eval.run import render

    render(options.scenarios, options.network, options.seed, options.workers, options.out)
    return DONE


def _report(options: argparse.Namespace) -> int:
    """Make DIR/report.html from DIR/results.json and the files beside it."""
    from hippodrome.eval.report import write_report

    print(write_report(options.results))
    return DONE


def _stress(options: argparse.Namespace) -> int:
    """Refine maps from real frames under noise, false closures, survey error and missing roads; a table with the worst cases."""
    from hippodrome.eval.stress import stress

    stress(options.scenarios, options.seeds, options.cases, options.workers, options.out)
    return DONE


def _map(options: argparse.Namespace) -> int:
    """Build the semi-metric cognitive map of a recording from its frames and self-motion."""
    from hippodrome.eval.stages import map_files

    map_files(options.recording, options.scenario, options.out)
    return DONE


def _refine(options: argparse.Namespace) -> int:
    """Constrain a semi-metric map with a road network (RC-HMM)."""
    from hippodrome.eval.stages import refine_files

    refine_files(options.map, options.network, options.mode, options.start, options.scenario, options.out)
    return DONE


def _localize(options: argparse.Namespace) -> int:
    """Localize a recorded drive in a topometric map from an unknown start; writes a TUM trajectory of the localized stretches."""
    from hippodrome.eval.stages import localize_files

    localize_files(options.map, options.recording, options.network, options.scenario, options.out)
    return DONE


def _robustness(options: argparse.Namespace) -> int:
    """Map once, then localize from several unknown starts under each of many conditions; writes a table and a heat map."""
    from hippodrome.eval.robustness import robustness

    robustness(options.scenario, options.conditions, options.sequences, options.workers, options.out)
    return DONE


def _baselines(options: argparse.Namespace) -> int:
    """Evaluate a scenario, run binocular ORB-SLAM3 on its mapping drive and write Table I with all rows; resumable."""
    from hippodrome.eval.baselines.run import BaselineOptions, run_baselines

    run_baselines(BaselineOptions(options.scenario, options.out, options.runs, options.workers, options.seconds, options.paced))
    return DONE


if __name__ == "__main__":
    sys.exit(main())
