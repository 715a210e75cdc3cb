"""``hippodrome run``: import a drive, map it, lay the map on the roads, score it, and make a page of it. What is done is kept."""

from __future__ import annotations

import hashlib
import io
import json
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TextIO, TypeVar

import numpy as np

from hippodrome._files import sha256_of, write_atomically
from hippodrome.core.types import CognitiveMap, HippodromeError, MatchBreak, MatchStatus, StartPose
from hippodrome.eval.exchange.drives.truth import stored_truth
from hippodrome.eval.methods.beforehand import Beforehand
from hippodrome.eval.methods.refusal import refusal_note
from hippodrome.eval.methods.stages import map_files, network_file, read_roads, refine_files
from hippodrome.eval.real.drive import Drive
from hippodrome.eval.real.findings import to_record, usual_error_m
from hippodrome.eval.real.findings_file import reference_of, tell_findings
from hippodrome.eval.real.kept import read_breaks, read_findings, read_record
from hippodrome.eval.real.page import drive_page
from hippodrome.proto.codec import load_map
from hippodrome.sim.geo_start import GeoStart
from hippodrome.sim.recording import MANIFEST, open_recording

RECORD: Final = "run.json"
RECORDING: Final = "recording"
SEMI_METRIC: Final = "semi.pbstream"
TOPOMETRIC: Final = "topo.pbstream"
REFINEMENT: Final = "refinement.json"
FINDINGS: Final = "findings.geojson"
PAGE: Final = "drive.html"
ResultT = TypeVar("ResultT")


@dataclass(frozen=True, slots=True)
class RunOptions:
    """What to run. ``asked`` is everything the user said that decides about the results, by the option's name."""

    drive: Path  # a recording, or what ``import_to`` imports
    network: Path  # SUMO, OpenStreetMap or OpenDRIVE
    out: Path
    start: StartPose | GeoStart | None
    known: Beforehand  # unit of the odometry, accuracy of the network
    import_to: Callable[[Path, Path], object] | None  # (recording to be made, SUMO network); None: ``drive`` is a recording
    score: Callable[[Path, Path], object]  # prints the errors of a map against a recording's truth
    asked: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class _Stages:
    """The stages of a run: announced, timed, and kept in ``run.json`` with what they said."""

    out: Path
    asked: Mapping[str, str]
    count: int
    done: dict[str, dict[str, Any]]  # name of a finished stage -> seconds and lines

    def run(self, name: str, result: Path | None, work: Callable[[], object]) -> None:
        """Do ``work`` unless its ``result`` is there from an earlier run; None does it each time."""
        place = f"{len(self.done) + 1}/{self.count} {name}"
        earlier = _record_of(self.out).get("stages", {}).get(name)
        if result is not None and result.exists():
            print(f"{place}: done before, {result} is kept", flush=True)
            self.done[name] = earlier or {"seconds": None, "said": []}
            return
        print(f"{place} ...", flush=True)
        began = time.monotonic()
        said = _overheard(work)
        self.done[name] = {"seconds": round(time.monotonic() - began, 1), "said": said}
        print(f"{place}: {self.done[name]['seconds']} s", flush=True)
        record = {"asked": dict(self.asked), "stages": self.done}
        write_atomically(self.out / RECORD, (json.dumps(record, indent=1) + "\n").encode())

    def said(self, name: str) -> list[str]:
        """The lines that a stage printed when it was done."""
        return list(self.done[name]["said"])


class _Tee(io.TextIOBase):
    """Text that goes on to ``stream`` and is kept."""

    def __init__(self, stream: TextIO) -> None:
        self.stream, self.kept = stream, io.StringIO()

    def write(self, text: str) -> int:
        self.kept.write(text)
        return self.stream.write(text)

    def flush(self) -> None:
        self.stream.flush()


def run_drive(options: RunOptions) -> None:
    """Do all stages of a drive that were not done before, and write its page.

    A map that no road vouches for is a result like any other: it is said in the last lines and on the page.

    Raises:
        HippodromeError: Something cannot be read, or ``out`` holds the results of another drive, map or option.
    """
    out = options.out
    asked = {**options.asked, "MAP": _content(options.network), "DRIVE": _content(options.drive)}
    _check_same(out, asked)
    stages = _Stages(out, asked, 5 + (options.import_to is not None), {})
    stages.run("roads", None, lambda: read_roads(options.network, out))
    net_file = _silently(lambda: network_file(options.network, out))
    recording = options.drive
    if options.import_to is not None:
        recording, write = out / RECORDING, options.import_to
        stages.run("import", recording / MANIFEST, lambda: write(recording, net_file))
    semi_metric, topometric = out / SEMI_METRIC, out / TOPOMETRIC
    stages.run("map", semi_metric, lambda: map_files(recording, None, semi_metric))
    stages.run("refine", out / REFINEMENT, lambda: _refine(options, net_file, topometric))
    stages.run("score", None, lambda: _score(options, topometric, recording))
    stages.run("page", None, lambda: _write_page(options, recording, net_file, stages))
    cognitive_map = load_map(topometric)[0]
    print(_verdict(cognitive_map, read_breaks(out / REFINEMENT, len(cognitive_map.t_s))))
    print(f"open {out / PAGE}")


def _check_same(out: Path, asked: Mapping[str, str]) -> None:
    """Raises HippodromeError if the folder holds results that were asked for otherwise, or is not ours.

    A run that ended before it had any result, as its options were wrong, may be told others.
    """
    if not out.exists() or not any(out.iterdir()):
        return
    if not (out / RECORD).exists() and not (out / RECORDING).exists():
        raise HippodromeError(f"{out}: holds other files than a run's; choose a new --out")
    imported = (out / RECORDING / MANIFEST).exists()
    if not imported and not (out / SEMI_METRIC).exists():
        return
    before = _record_of(out).get("asked", asked)
    if differing := sorted(name for name in {*before, *asked} if before.get(name) != asked.get(name)):
        hint = f" (the drive is imported already: give {out / RECORDING} as DRIVE)" if imported else ""
        raise HippodromeError(f"{out}: was made with another {', '.join(differing)}; choose a new --out{hint}")


def _record_of(out: Path) -> dict[str, Any]:
    path = out / RECORD
    return read_record(path) if path.exists() else {}


def _content(path: Path) -> str:
    """A file's hash; of a folder a hash of the names and sizes below it; of what is neither, its name."""
    if path.is_file():
        return sha256_of(path)
    found = sorted((str(one.relative_to(path)), one.stat().st_size) for one in path.rglob("*") if one.is_file())
    return hashlib.sha256(repr(found).encode()).hexdigest() if found else str(path)


def _overheard(work: Callable[[], object]) -> list[str]:
    """Do ``work``, and the lines that it printed meanwhile."""
    tee = _Tee(sys.stdout)
    with redirect_stdout(tee):
        work()
    return tee.kept.getvalue().splitlines()


def _silently(work: Callable[[], ResultT]) -> ResultT:
    """What ``work`` returns, without the lines that it prints: an earlier stage said them."""
    with redirect_stdout(io.StringIO()):
        return work()


def _refine(options: RunOptions, net_file: Path, topometric: Path) -> None:
    semi_metric = options.out / SEMI_METRIC
    refinement = refine_files(semi_metric, net_file, "route", options.start, None, topometric, options.known)
    found = tell_findings(refinement, net_file, options.out, options.known, options.out / FINDINGS)
    breaks = [
        {"first": one.first_vertex, "last": one.last_vertex, "status": one.status.name, "cause": one.cause}
        for one in refinement.breaks
    ]
    content = {
        "breaks": breaks,
        "estimates": {name: float(value) for name, value in refinement.estimates.items()},
        "findings": [to_record(one) for one in found],
        "map_error_m": usual_error_m(refinement),
    }
    write_atomically(options.out / REFINEMENT, (json.dumps(content, indent=1) + "\n").encode())


def _score(options: RunOptions, topometric: Path, recording: Path) -> None:
    """The scores, where there is a truth; a map that cannot be scored is none that cannot be used."""
    try:
        if stored_truth(open_recording(recording, verify=False)) is None:
            print("not scored: the drive came without truth")
            return
        options.score(topometric, recording)
    except HippodromeError as error:
        print(f"not scored: {error}")


def _write_page(options: RunOptions, recording: Path, net_file: Path, stages: _Stages) -> None:
    cognitive_map = load_map(options.out / TOPOMETRIC)[0]
    findings, map_error_m = read_findings(options.out / REFINEMENT, len(cognitive_map.t_s))
    drive = Drive(
        name=options.drive.name,
        network=options.network.name,
        recording=open_recording(recording, verify=False),
        cognitive_map=cognitive_map,
        roads=_silently(lambda: read_roads(net_file, options.out)),
        breaks=read_breaks(options.out / REFINEMENT, len(cognitive_map.t_s)),
        findings=findings,
        map_error_m=map_error_m,
        reference=reference_of(net_file),
        scores=tuple(stages.said("score")),
        notes=tuple(line for name in ("roads", "import", "refine") if name in stages.done for line in stages.said(name)),
        stages={name: one["seconds"] for name, one in stages.done.items()},
    )
    write_atomically(options.out / PAGE, drive_page(drive).encode())


def _verdict(cognitive_map: CognitiveMap, breaks: tuple[MatchBreak, ...]) -> str:
    """The last line but one: how much of the map may be trusted."""
    if (warning := refusal_note(cognitive_map)) is not None:
        return warning
    match = cognitive_map.road_match
    total = len(cognitive_map.t_s)
    good = total if match is None else int(np.count_nonzero(match.status == MatchStatus.MATCHED))
    left = f"; {len(breaks)} stretch(es) are not vouched for, the page says where and why" if breaks else ""
    return f"roads vouch for {good} of {total} vertices{left}"
