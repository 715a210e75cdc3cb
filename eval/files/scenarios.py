"""Scenario files as every command reads them: as ``sim.scenario`` does, but networks may also lie in installed packages."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path
from sysconfig import get_path
from typing import Any, Final

from hippodrome.eval.files.shipped import shipped
from hippodrome.sim.scenario import Scenario, load_scenario
from hippodrome.sim.yaml_file import ScenarioError

PACKAGE: Final = "package:"  # package:sumo/tools/game/bs3d/bs.net.xml is a file that an installed Python package has


def read_scenario(path: Path, network: Path | None = None, seed: int | None = None) -> Scenario:
    """The scenario in a file.

    Args:
        path: The file, or the name of a scenario that comes with the package, like ``towns/rural``.
        network: Road network that replaces the scenario's own.
        seed: Seed that replaces the scenario's own.

    Raises:
        HippodromeError: The file or its network cannot be used.
    """
    path = shipped(path)
    scenario = load_scenario(path, network, seed)
    named = scenario.town.network
    if named is None:
        return scenario
    town = scenario.town.model_copy(update={"network": located(named, f"{path}: town.network")})
    return scenario.model_copy(update={"town": town})


def located(network: Path, where: str) -> Path:
    """The file of a road network, which for ``package:PACKAGE/FILE`` lies in an installed package.

    Args:
        network: The path as it is written.
        where: Where it is written, for errors.

    Raises:
        ScenarioError: The package is not installed, or has no such file.
    """
    start = next((i for i, part in enumerate(network.parts) if part.startswith(PACKAGE)), None)
    if start is None:
        return network
    package, inside = network.parts[start].removeprefix(PACKAGE), Path(*network.parts[start + 1 :])
    root = _package_folder(package)
    if root is None:
        raise ScenarioError(
            f"{where}: the Python package '{package}' is not installed; install it (sumo comes with eclipse-sumo)"
        )
    if not (root / inside).is_file():
        raise ScenarioError(
            f"{where}: the installed package '{package}' has no file {inside.as_posix()}; "
            "another version may, or copy the network beside the scenario and name that"
        )
    return root / inside


def portable(network: Path) -> str:
    """The name of a network in results, which must not depend on the machine: ``package:...``, or else the file's name."""
    for site in map(Path, {get_path("purelib"), get_path("platlib")}):
        if network.is_relative_to(site):
            return f"{PACKAGE}{network.relative_to(site).as_posix()}"
    return network.name


def effective_configuration(scenario: Scenario) -> dict[str, Any]:
    """All values of a scenario, defaults included, as plain data for JSON. A network is named as ``portable`` does."""
    values: dict[str, Any] = json.loads(scenario.model_dump_json())  # JSON has no infinity: such a limit becomes null
    if scenario.town.network is not None:
        values["town"]["network"] = portable(scenario.town.network)
    for role in ("mapping", "localization"):
        recording = values[role].pop("recording")
        if recording is not None:  # a simulated drive has no such key, as before there was one: baselines go on comparing
            values[role]["recording"] = Path(recording).name
    return values


def _package_folder(package: str) -> Path | None:
    """The folder of an installed top-level package, which is not imported; None if there is none."""
    try:
        spec = find_spec(package) if package.isidentifier() else None
    except (ImportError, ValueError):
        return None
    places = list(spec.submodule_search_locations or ()) if spec is not None else []
    return Path(places[0]) if places else None
