"""``hippodrome scenario new``: a commented scenario with values that suit its road network."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import yaml

from hippodrome._files import write_atomically
from hippodrome._folders import temporary_folder
from hippodrome._output import one_line
from hippodrome.core.types import HippodromeError
from hippodrome.eval.authoring.network_notes import network_notes
from hippodrome.eval.authoring.sources import KINDS, require_source, unknown_kind
from hippodrome.eval.files.scenarios import PACKAGE, located
from hippodrome.sim.driving_side import Choice
from hippodrome.sim.map_import import KNOWN, import_map, is_foreign
from hippodrome.sim.net_cut import Around, cut_network, import_options
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.tour import tour_graph
from hippodrome.sim.town import build_town
from hippodrome.sim.town_spec import TownSpec
from hippodrome.sim.types import Town
from hippodrome.sim.value_words import SCENARIO_NAME
from hippodrome.sim.yaml_file import ScenarioError, load_yaml

TOUR_SHARE = 1.3  # length of the mapping tour over that of the drivable roads: all of them once, and 40 % seen before
TOUR_M = (1500.0, 7200.0)  # limits of the mapping tour: shorter ones close too few loops; the upper end is the paper's drive
LOCALIZATION_SHARE = 1 / 3  # length of the second drive's tour over that of the mapping tour
LOCALIZATION_M = (500.0, 1800.0)  # limits of the second drive's tour; the upper end is the paper's long test drive
VEHICLES_PER_KM = 3.0  # vehicles per kilometre of toured road: one in sight most of the time, no queues
FAST_MPS = 15.0  # median speed limit from which 10 frames a second are taken: 5 would leave more than 3 m between views
ROUND_TO_M = 100.0  # lengths of tours are rounded to this

TEMPLATE = """\
# {title}
# Try it:    hippodrome scenario preview {file}
# Score it:  hippodrome eval {file}
# Every key: docs/scenarios.md; a key left out has the default given there.
name: {name}
seed: 1  # of the generated town, the routes, the traffic and the noise
{town}
camera: {{rate_hz: {rate_hz:g}}}  # frames a second; odometry_rate_hz (10) must be a whole multiple of it
noise: paper  # of the self-motion: clean, paper, realistic or harsh
mapping:  # the drive that the map is built from
  tour: {{length_m: {tour_m:.0f}}}  # {tour_words}
  traffic: {{vehicles: {vehicles}}}  # on the road at the same time
localization:  # a second drive, on another route and among other traffic, that is localized in the map
  tour: {{length_m: {second_m:.0f}}}
  traffic: {{vehicles: {second_vehicles}}}
  conditions: {{sun_azimuth_deg: 120, sun_elevation_deg: 35}}  # the mapping drive has 210 and 45; also: overcast, dusk, season
thresholds:  # hippodrome eval exits with 1 where one of them does not hold
  method: topometric
  ape_mean_m: 5.0
  localization_success: true
"""


@dataclass(frozen=True, slots=True)
class Draft:
    """Values that suit a road network."""

    tour_m: float  # length of the mapping tour
    second_m: float  # length of the localization tour
    vehicles: int  # on the road at the same time while mapping
    rate_hz: float  # frames a second
    drivable_km: float  # length of the roads that can be toured
    notes: tuple[str, ...]  # what is odd about the network, with place and cure


def new_scenario(name: str, source: str, path: Path, driving_side: Choice = "auto", around: Around | None = None) -> Draft:
    """Write a scenario whose values suit a road network, and say what they are.

    Args:
        name: The scenario's name.
        source: A kind of town to be generated, one of ``KINDS``, or a map's file. A map that is no SUMO network is imported
            once: its network is written beside the scenario.
        path: The scenario's file.
        driving_side: Where traffic keeps in a generated town or an imported map; ``auto``: as the map says, else right.
        around: The circle of the map that is meant, which is then written beside the scenario; None: all of it.

    Raises:
        HippodromeError: The source or the name cannot be used, or a file that would be written exists.
    """
    if not re.fullmatch(SCENARIO_NAME, name):
        raise HippodromeError(
            f"'{name}': not a scenario's name, which folders are given: letters, digits, '.', '_', '-', "
            "a letter or digit first, at most 64; name it so, and the file as you like with --out"
        )
    require_source(source)
    if around and source in KINDS:
        raise HippodromeError(f"--around {around.first:g},{around.second:g}: '{source}' is generated; only a map is cut out of")
    network = path.with_name(f"{path.stem}.net.xml.gz") if around or _is_imported(source) else None
    for target in filter(None, (path, network)):
        if target.exists():
            raise HippodromeError(f"{target}: exists already; choose another --out, or remove it first")
    with temporary_folder() as folder:
        imported = folder / network.name if network else None
        imported_notes = _import(source, imported, driving_side, around) if imported else ()
        town = _town(source, imported, folder, driving_side)
        draft = draft_for(town)
        text = scenario_text(name, source, path, draft, driving_side, around)
        trial = folder / path.name
        trial.write_text(text, encoding="utf-8")
        scenario = _checked(trial, path)
        if network and imported:
            write_atomically(network, imported.read_bytes())
    write_atomically(path, text.encode())
    return replace(draft, notes=(*imported_notes, *network_notes(scenario, town)))


def _import(source: str, imported: Path, driving_side: Choice, around: Around | None) -> tuple[str, ...]:
    """Write the map, or the circle of it, as a SUMO network; the notes on it."""
    if is_foreign(source):
        return import_map(Path(source), imported, driving_side, import_options(around) if around else ())
    if around:
        found = located(Path(source), "--from")
        if not found.is_file():
            raise HippodromeError(f"--from {source}: neither a kind of town ({', '.join(KINDS)}) nor a file")
        cut_network(found, imported, around)
    return ()


def draft_for(town: Town) -> Draft:
    """Values that suit a town: lengths by the size of the part that can be toured, the frame rate by its speed limits."""
    network = town.network
    graph = tour_graph(network)
    drivable_m = float(graph.length_m.sum())
    tour_m = _rounded(float(np.clip(TOUR_SHARE * drivable_m, *TOUR_M)))
    toured_km = min(drivable_m, tour_m) / 1e3
    vehicles = max(2, round(VEHICLES_PER_KM * toured_km))
    fast = float(np.median(network.speed_limit_mps[~network.is_internal])) > FAST_MPS
    return Draft(
        tour_m=tour_m,
        second_m=_rounded(float(np.clip(LOCALIZATION_SHARE * tour_m, *LOCALIZATION_M))),
        vehicles=vehicles,
        rate_hz=10.0 if fast else 5.0,
        drivable_km=drivable_m / 1e3,
        notes=(),
    )


def scenario_text(
    name: str, source: str, path: Path, draft: Draft, driving_side: Choice = "auto", around: Around | None = None
) -> str:
    """The text of the scenario's file, with comments."""
    return TEMPLATE.format(
        title=_title(source, around),
        file=one_line(str(path)),
        name=_scalar(name),
        town=_town_line(source, path, driving_side, around),
        rate_hz=draft.rate_hz,
        tour_m=draft.tour_m,
        tour_words=_tour_words(draft),
        vehicles=draft.vehicles,
        second_m=draft.second_m,
        second_vehicles=round(1.5 * draft.vehicles),
    )


def _title(source: str, around: Around | None) -> str:
    """The first comment of the file."""
    if source in KINDS:
        return f"A generated town, {source}."
    within = f" within {around}" if around else ""
    return f"The roads of {one_line(Path(source).name)}{within}."


def _town_line(source: str, path: Path, driving_side: Choice, around: Around | None) -> str:
    """The line of the file that says where to drive."""
    if source in KINDS:
        return f"town: {_flow(_shipped_town(source, driving_side))}"
    if around or _is_imported(source):
        return f"town: {_flow({'network': f'{path.stem}.net.xml.gz'})}  # made by netconvert; netedit opens it"
    return f"town: {_flow({'network': source if source.startswith(PACKAGE) else _relative(source, path)})}"


def _tour_words(draft: Draft) -> str:
    """The comment on the mapping tour: how much of the roads it sees."""
    share = min(1.0, 0.6 * draft.tour_m / (1e3 * draft.drivable_km))
    return f"40 % of it on roads driven before; of the {draft.drivable_km:.1f} km that can be driven it sees about {share:.0%}"


def _is_imported(source: str) -> bool:
    return source not in KINDS and is_foreign(source)


def _town(source: str, imported: Path | None, folder: Path, driving_side: Choice) -> Town:
    """Build or read the town that the values have to suit, with ``folder`` for whatever has to be written.

    ``imported`` is the network made of a foreign map; errors about it name the map, which the user knows.
    """
    if source in KINDS:
        return build_town(TownSpec.model_validate(_shipped_town(source, driving_side)), 1, folder)
    network = imported or located(Path(source), "--from")
    if not network.is_file():
        raise HippodromeError(f"--from {source}: neither a kind of town ({', '.join(KINDS)}) nor a file")
    if not network.name.lower().endswith(KNOWN):
        raise unknown_kind(source, network)
    try:
        return build_town(TownSpec(network=network.resolve(), driving_side=driving_side), 1, folder)
    except HippodromeError as error:
        raise HippodromeError(str(error).replace(str(network), source)) from error


def _shipped_town(kind: str, driving_side: Choice) -> dict[str, object]:
    """The town of the scenario of this kind that comes with the package, so that sizes are chosen in one place."""
    text = (files("hippodrome.scenarios") / "towns" / f"{kind}.yaml").read_text(encoding="utf-8")
    town: dict[str, object] = yaml.safe_load(text)["town"]
    return town if driving_side == "auto" else {**town, "driving_side": driving_side}


def _relative(source: str, path: Path) -> str:
    """The network as seen from the scenario's folder, so that both can move together."""
    return Path(os.path.relpath(Path(source).resolve(), path.resolve().parent)).as_posix()


def _scalar(text: str) -> str:
    """A string as YAML writes it: quoted where it has to be."""
    return yaml.safe_dump(text, default_style=None, width=1000).removesuffix("...\n").strip()


def _flow(values: dict[str, object]) -> str:
    """A mapping as YAML in one line."""
    return yaml.safe_dump(values, default_flow_style=True, sort_keys=False, width=1000).strip()


def _checked(trial: Path, path: Path) -> Scenario:
    """Load what was written to ``trial``; only the name can be wrong. Errors speak of ``path``, where it will lie."""
    try:
        return load_yaml(trial, Scenario)
    except ScenarioError as error:
        raise ScenarioError(str(error).replace(str(trial), str(path))) from None


def _rounded(length_m: float) -> float:
    return ROUND_TO_M * round(length_m / ROUND_TO_M)
