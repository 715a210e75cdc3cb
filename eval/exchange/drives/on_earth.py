"""What is to be drawn on a map of the world: lines and vertices in latitude and longitude."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import numpy as np

from hippodrome._files import open_regular
from hippodrome.core.types import CognitiveMap, FloatArray, MatchStatus, Trajectory
from hippodrome.eval.exchange.drives.errors import ExchangeError
from hippodrome.eval.exchange.drives.exported import ExportedDrive
from hippodrome.eval.files.trajectories import read_tum
from hippodrome.proto.codec import load_map
from hippodrome.proto.pbstream import MAGIC
from hippodrome.sim.georeference import GeoReference, read_georeference

EPOCH_FROM_S = 1e8  # a clock that is past this counts from 1970, a smaller one from the start of the drive
VOUCHED = "matched"


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A trajectory, or the vertices of a map, on Earth."""

    name: str
    t_s: FloatArray  # (N,) seconds from the start of the drive
    lat_lon_deg: FloatArray  # (N, 2)
    epoch_s: float | None  # when the drive started, seconds since 1970; None: unknown
    status: tuple[str, ...] | None = None  # of each vertex of a map: "matched", or why no road vouches for it
    lane: tuple[str, ...] | None = None  # of each vertex of a map; "" where there is none
    sigma_m: FloatArray | None = None  # (N,) root mean square of a position's two standard deviations; nan: unknown

    def times(self) -> list[str] | None:
        """Date and time of each place in ISO 8601; None where the date is unknown."""
        if self.epoch_s is None:
            return None
        moments = (datetime.fromtimestamp(self.epoch_s + float(t), UTC) for t in self.t_s)
        return [moment.isoformat(timespec="microseconds").replace("+00:00", "Z") for moment in moments]

    def stretches(self) -> list[tuple[str, slice]]:
        """Runs of vertices of one status; one run, of what is vouched for, where there are no statuses.

        A run reaches to the first vertex of the next one, so that the line has no holes.
        """
        count = len(self.t_s)
        if self.status is None:
            return [("", slice(0, count))]
        cuts = [0, *(i for i in range(1, count) if self.status[i] != self.status[i - 1]), count]
        return [(self.status[a], slice(a, min(b + 1, count))) for a, b in pairwise(cuts)]


def placed_drive(drive: ExportedDrive) -> list[Place]:
    """Truth, estimates and maps of a drive that are in its network's frame.

    Raises HippodromeError if the network is not known, or does not say where on Earth it lies.
    """
    if drive.network_file is None:
        raise ExchangeError(
            f"{drive.name}: its road network was not found, so nobody knows where on Earth it lies; give --network"
        )
    reference = read_georeference(drive.network_file)
    epoch_s = _epoch_s(drive)
    found = []
    if drive.truth is not None and drive.recording.manifest.get("truth_frame", "network") == "network":
        found.append(_line("truth", drive.truth, reference, epoch_s))
    found += [_line(name, e.trajectory, reference, epoch_s) for name, e in drive.estimates.items() if e.frame == "network"]
    found += [_map(f"map {name}", value, reference, epoch_s) for name, value in drive.maps.items() if value.frame == "network"]
    if not found:
        raise ExchangeError(
            f"{drive.name}: nothing of it is in the road network's frame; export its topometric map or trajectory"
        )
    return found


def placed_file(source: Path, network: Path) -> Place:
    """A map or a TUM trajectory in the network's frame. Raises HippodromeError."""
    reference = read_georeference(network)
    with open_regular(source) as stream:
        is_map = stream.read(len(MAGIC)) == MAGIC
    if not is_map:
        return _line(source.stem, read_tum(source), reference, None)
    found = load_map(source)[0]
    if found.frame != "network":
        raise ExchangeError(f"{source}: a semi-metric map lies nowhere on Earth; run `hippodrome refine` first")
    return _map(source.stem, found, reference, None)


def _epoch_s(drive: ExportedDrive) -> float | None:
    imported = drive.recording.manifest.get("imported")
    origin_s = imported.get("time_origin_s", 0.0) if isinstance(imported, dict) else 0.0
    return float(origin_s) if isinstance(origin_s, int | float) and EPOCH_FROM_S < origin_s < 1e11 else None


def _line(name: str, trajectory: Trajectory, reference: GeoReference, epoch_s: float | None) -> Place:
    return Place(name, trajectory.t_s, reference.to_lat_lon(trajectory.poses), epoch_s)


def _map(name: str, found: CognitiveMap, reference: GeoReference, epoch_s: float | None) -> Place:
    status, lane, sigma_m = None, None, None
    if (match := found.road_match) is not None:
        status = tuple(MatchStatus(int(value)).name.lower() for value in match.status)
        lane = tuple(match.lane_ids[int(i)] if i >= 0 else "" for i in match.lane)
    if found.covariance is not None:
        variance = (found.covariance[:, 0, 0] + found.covariance[:, 1, 1]) / 2.0
        sigma_m = np.sqrt(np.where(variance >= 0.0, variance, np.nan))
    return Place(name, found.t_s, reference.to_lat_lon(found.poses), epoch_s, status, lane, sigma_m)
