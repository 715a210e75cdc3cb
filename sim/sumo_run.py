"""One SUMO simulation at a time: libsumo's calls and complaints stop here."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import libsumo
import numpy as np

from hippodrome._folders import temporary_folder
from hippodrome.core.roads.network import RoadNetwork
from hippodrome.core.types import FloatArray, HippodromeError, IntArray
from hippodrome.sim.network import HELD_PHASE_S
from hippodrome.sim.sumo_tools import without_comma, without_connectors
from hippodrome.sim.tour import TourGraph
from hippodrome.sim.traffic import KIND_SHARES, VEHICLE_SIZES_M, random_trip
from hippodrome.sim.traffic_spec import TrafficSpec

SUMO_STEP_S: Final = 0.1
EGO: Final = "ego"
REMOVE_AFTER_S: Final = 60  # vehicles blocked this long, in a knot that SUMO cannot undo, are taken off the road
GREEN_S: Final = 25.0  # of signals that have no timing of their own
ROOM_PER_VEHICLE_M: Final = 100.0  # denser traffic locks small towns up
SIGHT_M: Final = 150.0  # vehicles farther from the ego are not logged


@contextmanager
def sumo_run(net_file: Path, vehicle_types: str, seed: int) -> Iterator[None]:
    """Starts SUMO on a network in this process and closes it whatever happens."""
    with temporary_folder() as folder, without_connectors(net_file) as plain, without_comma(plain) as named:
        types_file = folder / "types.add.xml"
        types_file.write_text(vehicle_types, encoding="utf-8")
        options = (
            f"--net-file={named}",
            f"--additional-files={types_file}",
            f"--seed={seed % 2**31}",
            f"--step-length={SUMO_STEP_S}",
            f"--time-to-teleport={REMOVE_AFTER_S}",
            "--time-to-teleport.remove",
            "--max-depart-delay=5",
            "--collision.action=none",
            "--step-method.ballistic",
            "--xml-validation=never",
            "--no-step-log",
            "--no-warnings",
            "--duration-log.disable",
        )
        try:
            libsumo.start(["sumo", *options])
            _let_signals_run()
            yield
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            raise HippodromeError(f"{net_file}: SUMO failed: {' '.join(str(error).split())}") from error
        finally:
            libsumo.close()


def _let_signals_run() -> None:
    """Signals made to be switched by hand get one program that goes through all phases of all their programs by itself."""
    for signal in libsumo.trafficlight.getIDList():
        programs = libsumo.trafficlight.getAllProgramLogics(signal)
        phases = [phase for program in programs for phase in program.phases]
        if any(phase.duration > HELD_PHASE_S for phase in phases):
            cycle = [libsumo.trafficlight.Phase(min(phase.duration, GREEN_S), phase.state) for phase in phases]
            libsumo.trafficlight.setProgramLogic(signal, libsumo.trafficlight.Logic("by itself", 0, 0, cycle))


class BackgroundTraffic:
    """Keeps a number of vehicles on random trips, and tells where those near the ego are."""

    def __init__(
        self,
        spec: TrafficSpec,
        network: RoadNetwork,
        graph: TourGraph,
        area: IntArray,
        rng: np.random.Generator,
        in_space: bool = False,
    ) -> None:
        self._in_space = in_space
        area = _without_shared_lanes(network, graph, area)
        self._network, self._graph, self._area, self._rng = network, graph, area, rng
        self._wanted = min(spec.vehicles, int(graph.length_m[area].sum() / ROOM_PER_VEHICLE_M))
        self._kind: list[int] = []  # of each vehicle sent so far, its identity being its number

    def refill(self, ego_on_road: bool) -> None:
        """Sends vehicles on their way until the wanted number is on the road or waits for room."""
        there = libsumo.simulation.getMinExpectedNumber() - int(ego_on_road)
        for _ in range(self._wanted - there):
            number, kind = len(self._kind), int(self._rng.choice(len(KIND_SHARES), p=KIND_SHARES))
            trip = random_trip(self._graph, self._area, self._rng)
            add_vehicle(f"b{number}", f"kind{kind}", self._network, trip, "random_free")
            self._kind.append(kind)

    def near(self, x_m: float, y_m: float) -> tuple[list[int], list[tuple[float, ...]], list[int]]:
        """Identities, poses of the centres (5 numbers where roads climb) and kinds of the vehicles within ``SIGHT_M``."""
        ids: list[int] = []
        poses: list[tuple[float, ...]] = []
        kinds: list[int] = []
        for name in libsumo.vehicle.getIDList():
            if name == EGO:
                continue
            x, y = libsumo.vehicle.getPosition(name)
            if (x - x_m) ** 2 + (y - y_m) ** 2 > SIGHT_M**2:
                continue
            number = int(name[1:])
            heading = math.radians(90.0 - libsumo.vehicle.getAngle(name))
            half = 0.5 * float(VEHICLE_SIZES_M[self._kind[number], 0])
            ids.append(number)
            poses.append((x - half * math.cos(heading), y - half * math.sin(heading), heading, *self._height(name, half)))
            kinds.append(self._kind[number])
        return ids, poses, kinds

    def _height(self, name: str, half_m: float) -> tuple[float, ...]:
        """Height [m] and pitch [rad] of a vehicle's centre, ``half_m`` behind its front; nothing in a flat town."""
        if not self._in_space:
            return ()
        pitch_rad = math.radians(libsumo.vehicle.getSlope(name))
        return libsumo.vehicle.getPosition3D(name)[2] - half_m * math.sin(pitch_rad), pitch_rad


def _without_shared_lanes(network: RoadNetwork, graph: TourGraph, area: IntArray) -> IntArray:
    """The edges of an area without those that share their lane with the other direction: whoever met there could not go on."""
    shared = [bool(libsumo.edge.getBidiEdge(network.edge_ids[edge])) for edge in graph.edges[area]]
    return area[~np.array(shared, dtype=np.bool_)]


def add_vehicle(name: str, vehicle_type: str, network: RoadNetwork, edges: Sequence[int], depart_position: str) -> None:
    """Puts a vehicle on a route of the network's edges as soon as there is room."""
    libsumo.route.add(f"route-{name}", [network.edge_ids[edge] for edge in edges])
    libsumo.vehicle.add(name, f"route-{name}", typeID=vehicle_type, departLane="best", departPos=depart_position)


def drawn_length_factors(network: RoadNetwork) -> FloatArray:
    """Metres as drawn per metre as SUMO counts them, for each lane: SUMO's ``length`` attribute is free to differ."""
    counted = np.array([libsumo.lane.getLength(lane) for lane in network.lane_ids])
    factors: FloatArray = network.lane_lengths_m() / np.maximum(counted, 1e-3)
    return factors
