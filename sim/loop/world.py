"""The world in the loop: SUMO, the scene and the ego, stepped together at 10 Hz."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import TracebackType
from typing import ClassVar, Final, Self

import libsumo
import numpy as np

from hippodrome.core.navigation.types import Indicator
from hippodrome.core.types import Frame, HippodromeError, Observation
from hippodrome.sim.ego_spec import LENGTH_M
from hippodrome.sim.loop.ahead import Lookout
from hippodrome.sim.loop.barriers import bar, closed_edges
from hippodrome.sim.loop.car import Car, travelled_m
from hippodrome.sim.loop.events import Watch
from hippodrome.sim.loop.footing import height_and_pitch, stand
from hippodrome.sim.loop.ground import Ground
from hippodrome.sim.loop.lamps import signal_heads
from hippodrome.sim.loop.moment import Moment
from hippodrome.sim.loop.odometry import Odometry
from hippodrome.sim.loop.puppet import Puppet
from hippodrome.sim.loop.radar import measured, nearest_ahead, with_surroundings
from hippodrome.sim.loop.recorder import Recorder
from hippodrome.sim.loop.rights import Rights
from hippodrome.sim.loop.sight import Sight
from hippodrome.sim.loop.start import clear_room, drawn_start, lane_and_position
from hippodrome.sim.loop.top_view import TopView
from hippodrome.sim.loop.turnround import Courtesy, Manoeuvre
from hippodrome.sim.loop.types import EventKind, LanePlace, Sensed, Truth
from hippodrome.sim.loop.users import Onlooker
from hippodrome.sim.loop.walls import Walls
from hippodrome.sim.loop.ways import Ways
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.scene.build import scene_origin_m
from hippodrome.sim.sumo_run import SUMO_STEP_S, BackgroundTraffic, sumo_run
from hippodrome.sim.tour import tour_graph, toured_area
from hippodrome.sim.town import build_town
from hippodrome.sim.traffic import vehicle_types_xml

STEP_S: Final = SUMO_STEP_S
WARM_UP_S: Final = 20.0  # traffic spreads before the ego is there
REFILL_STEPS: Final = 10  # traffic is topped up once a second
ROAM_PER_VEHICLE_M: Final = 200.0  # as for recorded drives


class World:
    """A scenario's town with its traffic, in which somebody drives the ego.

    SUMO and GL are one per process: a world that is reset takes them from another one. The localization drive of the scenario
    says traffic, light and weather. The same seed and the same commands give the same bytes.

    Args:
        scenario: what to build; its camera, noise and localization drive count.
        root: folder below which generated towns are kept.
        draw: whether frames are drawn; without them observations have none, no GL is needed and a step costs a third.
        closed: SUMO's names of roads on which nobody gets through: a van stands across each lane, and traffic goes elsewhere.
    """

    _live: ClassVar[World | None] = None  # SUMO and GL are one per process: whoever is reset takes them

    def __init__(self, scenario: Scenario, root: Path, draw: bool = True, closed: Sequence[str] = ()) -> None:
        self.scenario = scenario
        self.town = build_town(scenario.town, scenario.seed, root / "towns")
        self.network = self.town.network
        self.ground, self.ways = Ground(self.town), Ways(self.network)
        self._graph = tour_graph(self.network)
        self._drive = scenario.localization
        self._rights = Rights(self.town.net_file, self.network)
        self._lookout = Lookout(self.ground, self.ways, self._rights)
        mapped_m = (1.0 - scenario.mapping.tour.revisit_share) * scenario.mapping.tour.planned_length_m()
        area = toured_area(self._graph, max(mapped_m, ROAM_PER_VEHICLE_M * self._drive.traffic.vehicles))
        self.closed_roads = tuple(closed)
        self._closed = closed_edges(self.network, closed)
        self._area = area[~np.isin(self._graph.edges[area], self._closed)]
        self._walls = Walls(self.town, scenario.seed, scene_origin_m(self.town))
        self.heads = signal_heads(self.ground, self.ways, self._rights)
        self._sight = Sight(scenario, self.town, self.heads, STEP_S)
        self._draw = draw
        self._recorder: Recorder | None = None
        self._sumo: ExitStack | None = None

    @property
    def put_back(self) -> int:
        """How often SUMO had taken the ego off the road since the reset; it was put back at once."""
        return self._puppet.put_back

    @property
    def misplaced(self) -> int:
        """Steps since the reset after which SUMO had the ego on another lane than it is on: others may not have seen it."""
        return self._puppet.misplaced

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Ends SUMO and frees the renderer; a second call does nothing."""
        self._end()
        self._sight.close()
        if World._live is self:
            World._live = None

    def _end(self) -> None:
        if self._sumo is not None:
            self._sumo.close()
            self._sumo = None

    def reset(self, seed: int, start: LanePlace | None = None) -> Sensed:
        """Begins anew: fresh traffic, the ego standing at ``start``, or at a place drawn by the seed.

        Raises HippodromeError where the place is not on the network, or SUMO fails.
        """
        if World._live is not None:
            World._live.close() if World._live is not self else self._end()
        World._live = self
        rngs = [np.random.default_rng([seed, k]) for k in range(5)]
        rng_traffic, rng_start, self._rng_odometry, self._rng_radar, self._rng_around = rngs
        self._seed, ego = seed, self._drive.ego
        edges = self._graph.edges[self._area]
        place = drawn_start(self.network, edges, rng_start) if start is None else lane_and_position(self.network, start)
        lane, position_m = place
        self._sumo = ExitStack()
        types = vehicle_types_xml(ego.accel_mps2, ego.decel_mps2, LENGTH_M)
        self._sumo.enter_context(sumo_run(self.town.net_file, types, seed))
        climbs = self.town.heights_m is not None
        vans = bar(self.network, self._closed)
        traffic = self._drive.traffic.model_copy(update={"vehicles": self._drive.traffic.vehicles + vans})
        self._others = BackgroundTraffic(traffic, self.network, self._graph, self._area, rng_traffic, climbs)
        self._watch = Watch(self._rights)
        self._onlooker, self._puppet = Onlooker(climbs), Puppet(self.network, self.ways)
        self._odometry = Odometry(self.scenario.self_motion_noise, self._rng_odometry)
        for step in range(round(WARM_UP_S / STEP_S)):
            if step % REFILL_STEPS == 0:
                self._others.refill(ego_on_road=False)
            libsumo.simulationStep()
        self._car = Car(*self.ground.pose_at(lane, position_m))
        self._steps, self._driven_m = 0, 0.0
        self._lane, self._front_lane, self._before = lane, lane, lane
        self._indicator, self._accel_mps2 = Indicator.STRAIGHT, 0.0
        self._manoeuvre, self._courtesy, self._reverse = Manoeuvre(), Courtesy(), False
        self._signals: dict[int, str] = {}
        self.cleared = clear_room(self._onlooker.near(*self._car.pose_m[:2]), self._car.pose_m)
        self._move()
        return self._sensed(0.0, 0.0)

    def step(
        self, acceleration_mps2: float, steering_rad: float, indicator: Indicator = Indicator.STRAIGHT, reverse: bool = False
    ) -> Sensed:
        """Drives on for a tenth of a second.

        Args:
            acceleration_mps2: in the direction of the gear, negative brakes; held to what the car can do.
            steering_rad: of the road wheels, left positive; they turn no faster than a driver turns them.
            indicator: what the driver means to do at the junction ahead.
            reverse: the reverse gear; a car that still rolls forwards brakes first.

        Raises HippodromeError where a command is not a finite number, there was no reset, or SUMO fails.
        """
        if self._sumo is None:
            raise HippodromeError("world: step() before reset(), or after close() or another world's reset; call reset(seed)")
        if not (math.isfinite(acceleration_mps2) and math.isfinite(steering_rad)):
            raise HippodromeError(
                f"world: command ({acceleration_mps2}, {steering_rad}) at {self._steps * STEP_S:.1f} s is not two finite numbers"
            )
        before, speed, heading = self._car.pose_m, self._car.speed_mps, self._car.heading_rad
        self._car.drive(acceleration_mps2, steering_rad, STEP_S, reverse)
        travelled = travelled_m(before, self._car.pose_m)
        self._driven_m += abs(travelled)
        self._manoeuvre.go_on(travelled, self._car.speed_mps, reverse)
        self._reverse, self._indicator = reverse, indicator
        self._accel_mps2 = (self._car.speed_mps - speed) / STEP_S
        self._steps += 1
        if self._steps % REFILL_STEPS == 0:
            self._others.refill(ego_on_road=True)
        self._move()
        return self._sensed(travelled, self._car.heading_rad - heading)

    def teleport(self, pose_m: tuple[float, float, float]) -> None:
        """Stands the ego somewhere else, for tests and experiments; it is there from the next step on."""
        self._car = Car(*pose_m)
        self._lane = self._front_lane = self._before = -1

    def _move(self) -> None:
        """Finds the ego's lanes, tells SUMO, lets SUMO step, and looks round."""
        pose, signals = self._car.pose_m, self._signals
        self._footing = stand(self.ground, pose, self._lane, self._front_lane, self._expected())
        self._lane, self._front_lane = self._footing.lane, self._footing.front_lane
        last = self._before
        if self._front_lane >= 0 and not self.network.is_internal[self._front_lane]:
            self._before = self._front_lane
        self._lift = height_and_pitch(self.ground, pose, self._footing)
        speed, put_back = self._car.speed_mps, self.put_back
        try:
            self._puppet.place(self._footing.front_m, speed, self._front_lane, self._before, self._indicator, self._reverse)
            libsumo.simulationStep()
            self._puppet.check(self._front_lane)
            self._users = self._onlooker.near(*pose[:2])
            self._ahead = self._lookout.look(self._footing, self._before, self._indicator, speed, self._users, pose[:2])
            user_lanes = self._lookout.lanes_of(self._users)
            self._courtesy.look(pose, self._users, self._manoeuvre.is_under_way)
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            raise HippodromeError(f"{self.town.net_file}: SUMO failed: {' '.join(str(error).split())}") from error
        self._truth = self._look_down()
        now = self._signals = self._ahead.signals
        moment = Moment(
            truth=self._truth,
            users=self._users,
            user_lanes=user_lanes,
            front_lane=self._front_lane,
            against=self._footing.against,
            line=self.ground.line(self._lane, self._front_lane, self._before),
            strip_outside_m=self._footing.strip_outside_m,
            off_road=self._footing.off_road,
            signals={lane: (signals[lane], now[lane]) for lane in now if lane in signals} if last == self._before else {},
            coming=self._ahead.coming,
            building=self._footing.off_paving_m > 0.0 and self._walls.touch(pose),
            put_back=self.put_back > put_back,
            turns_round=self._manoeuvre.is_under_way,
            backed_m=self._manoeuvre.backed_m,
        )
        self._events = self._watch.look(moment)
        if any(event.kind in (EventKind.COLLISION, EventKind.BUILDING) for event in self._events):
            self._car.halt()

    def _sensed(self, travelled_m: float, turned_rad: float) -> Sensed:
        truth, pose = self._truth, self._truth.pose_m
        speed, yaw_rate = self._odometry.sense(travelled_m / self._level(), turned_rad, STEP_S)
        gap, other = nearest_ahead(pose, self._car.curvature_1pm, self._users, own_mps=self._car.speed_mps)
        radar = measured(gap, other, self._car.speed_mps, self._ahead.way_is_free, self._ahead.lamp, self._rng_radar)
        radar = with_surroundings(radar, pose, self._car.curvature_1pm, self._users, self._rng_around)
        frame: Frame | None = None
        if self._draw and self._sight.is_due(self._steps):
            seen_from = np.array([*pose, *self._lift])
            frame = self._sight.frame(seen_from, self._users, np.random.default_rng([self._seed, self._steps]))
        observation = Observation(truth.t_s, STEP_S, speed, yaw_rate, frame)
        sensed = Sensed(observation, radar, truth, self._events, self._users.poses_m)
        if self._recorder is not None:
            self._recorder.add(sensed, self._users, self._seed, self._lift[:1])
        return sensed

    @contextmanager
    def recording(self, folder: Path) -> Iterator[None]:
        """Writes the drive that begins with the next ``reset`` in the block as a recording, which is finished after the block.

        Raises HippodromeError where there is something in the ``folder`` already, or no drive was made.
        """
        self._recorder = Recorder(folder, self.scenario, self.network)
        try:
            yield
            self._recorder.finish(self.town.net_file)
        finally:
            self._recorder = None

    def picture(self, view: TopView) -> Frame:
        """The town from above, as it is now."""
        pose, users = self._car.pose_m, self._users
        return view.draw(pose, users.poses_m, users.sizes_m, self._lookout.lamps_near(*pose[:2], view.reach_m))

    def _level(self) -> float:
        """Metres seen from above, as the bicycle is driven, per metre along the slope, as its wheels roll."""
        return math.cos(self._lift[1]) if self._lift else 1.0

    def _expected(self) -> int:
        """The first lane inside the junction ahead that the indicator means; in the junction, the one that the front is on."""
        if self._front_lane >= 0 and self.network.is_internal[self._front_lane]:
            return self._front_lane
        way = self.ways.meant(self._before, self._indicator) if self._before >= 0 else None
        return way.inside[0] if way is not None and way.inside else -1

    def _look_down(self) -> Truth:
        pose, car, footing = self._car.pose_m, self._car, self._footing
        return Truth(
            t_s=self._steps * STEP_S,
            x_m=pose[0],
            y_m=pose[1],
            heading_rad=pose[2],
            speed_mps=car.speed_mps / self._level(),
            yaw_rate_radps=car.speed_mps * car.curvature_1pm,
            acceleration_mps2=self._accel_mps2,
            steering_rad=car.steering_rad,
            indicator=self._indicator,
            lane=footing.lane,
            lane_id=self.network.lane_ids[footing.lane] if footing.lane >= 0 else "",
            lane_position_m=footing.position_m,
            offset_m=footing.offset_m,
            lane_heading_error_rad=footing.heading_error_rad,
            wheel_outside_m=footing.off_paving_m if self._manoeuvre.is_under_way else footing.wheel_outside_m,
            off_paving_m=footing.off_paving_m,
            in_junction=footing.in_junction,
            driven_m=self._driven_m,
        )
