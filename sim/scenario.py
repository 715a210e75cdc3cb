"""The scenario: one model of everything that a run depends on. Each part is declared beside the code that it configures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from hippodrome.core.localization.config import LocalizerConfig
from hippodrome.core.mapping.config import MapperConfig
from hippodrome.core.refinement.config import RefineConfig
from hippodrome.sim.ego_spec import EgoSpec
from hippodrome.sim.method_spec import MethodSpec
from hippodrome.sim.mission_spec import MissionLimits, MissionSpec
from hippodrome.sim.renamed import with_present_names
from hippodrome.sim.render.camera import CameraSpec, camera_divider
from hippodrome.sim.scene.conditions_spec import Conditions
from hippodrome.sim.self_motion import NoiseLevel, SelfMotionNoise, noise_of
from hippodrome.sim.spec import Spec
from hippodrome.sim.tour_spec import TourSpec
from hippodrome.sim.town_spec import TownSpec
from hippodrome.sim.traffic_spec import TrafficSpec
from hippodrome.sim.value_words import METHOD_NAME, SCENARIO_NAME
from hippodrome.sim.yaml_file import load_yaml

ClosedCount = Annotated[int, Field(ge=0, le=100)]
MethodName = Annotated[str, Field(pattern=METHOD_NAME)]  # it stands in tables, and files are named after it


class DriveSpec(Spec):
    """One drive through the town: where, among whom, in which light; or a recording of a drive that was made elsewhere."""

    tour: TourSpec
    recording: Path | None = None  # folder of a recording, as `hippodrome import` writes, in place of the simulated drive
    traffic: TrafficSpec = TrafficSpec()
    ego: EgoSpec = EgoSpec()
    closed: tuple[str, ...] | ClosedCount = ()  # roads where missions meet a van on each lane: SUMO's names, or how many to draw
    conditions: Conditions = Conditions()

    @model_validator(mode="before")
    @classmethod
    def _recorded(cls, data: Any) -> Any:
        """A drive that was recorded elsewhere needs no tour."""
        if isinstance(data, dict) and data.get("recording") is not None:
            return {"tour": {"length_m": 3600}, **data}
        return data


class Thresholds(Spec):
    """Limits that make ``hippodrome eval``, ``drive`` and ``gate`` exit with 1; a limit left out is not checked."""

    method: str = "topometric (paper)"  # the row that the limits speak of
    ape_mean_m: Annotated[float, Field(gt=0)] | None = None
    rpe_mean_m: Annotated[float, Field(gt=0)] | None = None
    localization_error_mean_m: Annotated[float, Field(gt=0)] | None = None
    localization_success: bool = False  # True: localization must succeed
    false_fixes: Annotated[int, Field(ge=0)] | None = None
    drive: MissionLimits = MissionLimits()  # of missions


class Scenario(Spec):
    """A town, two different drives through it (one to map, one to localize), what is sensed, and how the result is judged."""

    name: Annotated[str, Field(pattern=SCENARIO_NAME)]
    description: str = ""
    seed: Annotated[int, Field(ge=0, lt=2**31)] = 1
    town: TownSpec = TownSpec()
    camera: CameraSpec = CameraSpec()
    odometry_rate_hz: Annotated[float, Field(ge=0.01, le=200)] = 10.0
    noise: NoiseLevel | SelfMotionNoise = "paper"
    mapping: DriveSpec = DriveSpec(tour=TourSpec(length_m=3600))
    localization: DriveSpec = DriveSpec(tour=TourSpec(length_m=1200))
    mapper: MapperConfig = MapperConfig()
    refine: RefineConfig = RefineConfig()
    localizer: LocalizerConfig = LocalizerConfig()
    methods: dict[MethodName, MethodSpec] = Field(default_factory=dict)  # that take part beside ours, by name
    missions: MissionSpec = MissionSpec()
    thresholds: Thresholds = Thresholds()

    @model_validator(mode="before")
    @classmethod
    def _old_names(cls, data: Any) -> Any:
        return with_present_names(data)

    @model_validator(mode="before")
    @classmethod
    def _camera_is_known(cls, data: Any) -> Any:
        """The camera of a simulated drive is known, so mapper and localizer read the road; one askew sees other road."""
        if not isinstance(data, dict):
            return data
        camera = data.get("camera", {})
        camera = camera.model_dump() if isinstance(camera, CameraSpec) else camera
        if not isinstance(camera, dict):
            return data
        seat = {name: camera[name] for name in ("fov_deg", "height_m", "forward_m") if name in camera}
        told = {}
        for part, role in (("localizer", "localization"), ("mapper", "mapping")):
            own, drive = data.get(part, {}), data.get(role) or {}
            if isinstance(own, dict):
                is_recorded = getattr(drive, "recording", None) or (isinstance(drive, dict) and "recording" in drive)
                told[part] = {"road_reading": not is_recorded and not camera.get("yaw_offset_deg"), "camera": seat, **own}
        return {**data, **told}

    @model_validator(mode="after")
    def _rates_fit(self) -> Scenario:
        camera_divider(self.camera, self.odometry_rate_hz)
        return self

    def __hash__(self) -> int:
        return hash((self.name, self.seed))  # equal scenarios have equal ones; the dictionary of methods has no hash

    @property
    def noise_name(self) -> str:
        return self.noise if isinstance(self.noise, str) else "custom"

    @property
    def self_motion_noise(self) -> SelfMotionNoise:
        return noise_of(self.noise)


def load_scenario(path: Path, network: Path | None = None, seed: int | None = None) -> Scenario:
    """The scenario in ``path``; ``network`` and ``seed`` replace its own. A relative network is relative to the file."""
    scenario = load_yaml(path, Scenario)
    town = scenario.town
    if network is not None:
        town = TownSpec(network=network.resolve())
    elif town.network is not None:
        town = town.model_copy(update={"network": (path.parent / town.network).resolve()})
    drives = {role: _placed(getattr(scenario, role), path.parent) for role in ("mapping", "localization")}
    return scenario.model_copy(update={"town": town, "seed": scenario.seed if seed is None else seed, **drives})


def _placed(drive: DriveSpec, folder: Path) -> DriveSpec:
    """The drive with its recording as a whole path; a relative one is relative to ``folder``."""
    if drive.recording is None:
        return drive
    return drive.model_copy(update={"recording": (folder / drive.recording).resolve()})
