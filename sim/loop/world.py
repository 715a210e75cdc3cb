"""The world in the loop: SUMO, the scene and the ego, stepped together at 10 Hz."""

from __future__ import annotations

import math
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self

import libsumo
import numpy as np

from hippodrome.core.navigation.types import Indicator, Lamp
from hippodrome.core.types import FloatArray, Frame, HippodromeError, Observation
from hippodrome.sim.ego import LENGTH_M, REAR_AXLE_TO_FRONT_M, WHEELBASE_M
from hippodrome.sim.loop.car import Car, ahead_of, wheels_m
from hippodrome.sim.loop.ground import Ground
from hippodrome.sim.loop.odometry import Odometry
from hippodrome.sim.loop.puppet import Puppet
from hippodrome.sim.loop.radar import measured, nearest_ahead
from hippodrome.sim.loop.types import Event, LanePlace, Sensed, Truth
from hippodrome.sim.loop.users import Onlooker
from hippodrome.sim.loop.ways import Ways
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.scene.build import build_scene
from hippodrome.sim.scene.conditions import apply_camera
from hippodrome.sim.sumo_run import SUMO_STEP_S, BackgroundTraffic, sumo_run
from hippodrome.sim.tour import tour_graph, toured_area
from hippodrome.sim.town import build_town
from hippodrome.sim.traffic import vehicle_types_xml

if TYPE_CHECKING:
    from hippodrome.sim.render.renderer import FrameRenderer

STEP_S: Final = SUMO_STEP_S
WARM_UP_S: Final = 20.0  # traffic spreads before the ego is there
REFILL_STEPS: Final = 10  # traffic is topped up once a second
ROAM_PER_VEHICLE_M: Final = 200.0  # as for recorded drives
ROOM_AHEAD_M: Final = 12.0  # at the start the road is clear this far before and behind the ego
ENDS_M: Final = 3.0  # a drawn start keeps this far from its lane's ends


class World:
    """A scenario's town with its traffic, in which somebody drives the ego. One at a time per process, as SUMO and GL want it.

    The localization drive of the scenario says traffic, light and weather. The same seed and the same commands give the same
    bytes.

    Args:
        scenario: what to build; its camera, noise and localization drive count.
        root: folder below which generated towns are kept.
        draw: whether frames are drawn; without them observations have none, no GL is needed and a step costs a third.
    """

    def __init__(self, scenario: Scenario, root: Path, draw: bool = True) -> None:
        self.scenario = scenario
        self.town = build_town(scenario.town, scenario.seed, root / "towns")
        self.network = self.town.network
        self.ground, self.ways = Ground(self.town), Ways(self.network)
        self._graph = tour_graph(self.network)
        self._drive = scenario.localization
        self._renderer: FrameRenderer | None = None
        self._draw = draw
        self._sumo: ExitStack | None = None

    @property
    def put_back(self) -> int:
        """How often SUMO had taken the ego off the road since the reset; it was put back at once."""
        return self._puppet.put_back

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Ends SUMO and frees the renderer; a second call does nothing."""
        if self._sumo is not None:
            self._sumo.close()
            self._sumo = None
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def reset(self, seed: int, start: LanePlace | None = None) -> Sensed:
        """Begins anew: fresh traffic, the ego standing at ``start``, or at a place drawn by the seed.

        Raises HippodromeError where the place is not on the network, or SUMO fails.
        """
        if self._sumo is not None:
            self._sumo.close()
        rng_traffic, rng_start, self._rng_odometry, self._rng_radar = (np.random.default_rng([seed, k]) for k in range(4))
        self._seed, ego = seed, self._drive.ego
        lane, position_m = self._start(start, rng_start)
        self._sumo = ExitStack()
        types = vehicle_types_xml(ego.accel_mps2, ego.decel_mps2, LENGTH_M)
        self._sumo.enter_context(sumo_run(self.town.net_file, types, seed))
        mapped_m = (1.0 - self.scenario.mapping.tour.revisit_share) * self.scenario.mapping.tour.planned_length_m()
        roamed_m = max(mapped_m, ROAM_PER_VEHICLE_M * self._drive.traffic.vehicles)
        climbs = self.town.heights_m is not None
        area = toured_area(self._graph, roamed_m)
        self._others = BackgroundTraffic(self._drive.traffic, self.network, self._graph, area, rng_traffic, climbs)
        self._onlooker, self._puppet = Onlooker(climbs), Puppet(self.network, self.ways)
        self._odometry = Odometry(self.scenario.self_motion_noise, self._rng_odometry)
        for step in range(round(WARM_UP_S / STEP_S)):
            if step % REFILL_STEPS == 0:
                self._others.refill(ego_on_road=False)
            libsumo.simulationStep()
        self._car = Car(*self.ground.pose_at(lane, position_m))
        self._steps, self._driven_m, self._frames = 0, 0.0, 0
        self._lane, self._front_lane, self._before = lane, lane, lane
        self._indicator, self._accel_mps2 = Indicator.STRAIGHT, 0.0
        self.cleared = self._clear_room()
        self._move()
        return self._sensed(0.0, 0.0)

    def step(self, acceleration_mps2: float, steering_rad: float, indicator: Indicator = Indicator.STRAIGHT) -> Sensed:
        """Drives on for a tenth of a second.

        Args:
            acceleration_mps2: along the vehicle, negative brakes; held to what the car can do.
            steering_rad: of the road wheels, left positive; they turn no faster than a driver turns them.
            indicator: what the driver means to do at the junction ahead.

        Raises:
            HippodromeError: a command is not a finite number, there was no reset, or SUMO fails.
        """
        if self._sumo is None:
            raise HippodromeError("world: step() before reset(), or after close(); call reset(seed) first")
        if not (math.isfinite(acceleration_mps2) and math.isfinite(steering_rad)):
            raise HippodromeError(
                f"world: command ({acceleration_mps2}, {steering_rad}) at {self._steps * STEP_S:.1f} s is not two finite numbers"
            )
        before, speed, heading = self._car.pose_m, self._car.speed_mps, self._car.heading_rad
        self._car.drive(acceleration_mps2, steering_rad, STEP_S)
        self._indicator, self._accel_mps2 = indicator, (self._car.speed_mps - speed) / STEP_S
        self._steps += 1
        if self._steps % REFILL_STEPS == 0:
            self._others.refill(ego_on_road=True)
        self._move()
        now = self._car.pose_m
        travelled = math.hypot(now[0] - before[0], now[1] - before[1])
        self._driven_m += travelled
        return self._sensed(travelled, self._car.heading_rad - heading)

    def _start(self, start: LanePlace | None, rng: np.random.Generator) -> tuple[int, float]:
        """Lane and position of the rear axle at the start."""
        network = self.network
        if start is not None:
            if start.lane_id not in network.lane_ids:
                raise HippodromeError(f"{self.town.net_file}: no lane {start.lane_id!r} for cars, where the drive is to start")
            return network.lane_ids.index(start.lane_id), start.position_m
        room = REAR_AXLE_TO_FRONT_M + 2.0 * ENDS_M
        lengths = network.lane_lengths_m()
        inside = np.isin(network.lane_edge, self._graph.edges) & ~network.is_internal
        long = np.flatnonzero(inside & (lengths > room))
        lanes = long if len(long) else np.flatnonzero(inside)
        spare = np.maximum(lengths[lanes] - room, 0.1)
        lane = int(rng.choice(lanes, p=spare / spare.sum()))
        return lane, min(ENDS_M, 0.5 * float(lengths[lane])) + float(rng.uniform(0.0, max(lengths[lane] - room, 0.0)))

    def _clear_room(self) -> int:
        """Takes the vehicles off the road that are where the ego begins; how many."""
        users = self._onlooker.near(*self._car.pose_m[:2])
        middle = ahead_of(self._car.pose_m, 0.5 * WHEELBASE_M)
        near = np.hypot(*(users.poses_m[:, :2] - middle).T) < ROOM_AHEAD_M
        for k in np.flatnonzero(near):
            libsumo.vehicle.remove(users.names[k])
        return int(near.sum())

    def _move(self) -> None:
        """Finds the ego's lanes, tells SUMO, and lets SUMO step."""
        pose = self._car.pose_m
        points = np.array([pose[:2], ahead_of(pose, REAR_AXLE_TO_FRONT_M), *wheels_m(pose)])
        self._near = self.ground.near(points)
        self._column = self.ground.lane_of(self._near, 0, pose[2], self._lane)
        front = self.ground.lane_of(self._near, 1, pose[2], self._front_lane)
        self._lane = int(self._near.lane[self._column]) if self._column >= 0 else -1
        self._front_lane = int(self._near.lane[front]) if front >= 0 else -1
        if self._front_lane >= 0 and not self.network.is_internal[self._front_lane]:
            self._before = self._front_lane
        try:
            self._way = self._puppet.place(pose, self._car.speed_mps, self._front_lane, self._before, self._indicator)
            libsumo.simulationStep()
            self._users = self._onlooker.near(*pose[:2])
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            raise HippodromeError(f"{self.town.net_file}: SUMO failed: {' '.join(str(error).split())}") from error

    def _sensed(self, travelled_m: float, turned_rad: float) -> Sensed:
        t_s = self._steps * STEP_S
        speed, yaw_rate = self._odometry.sense(travelled_m, turned_rad, STEP_S)
        truth = self._truth(t_s)
        gap, other = nearest_ahead(truth.pose_m, self._car.curvature_1pm, self._users)
        radar = measured(gap, other, self._car.speed_mps, True, Lamp.NONE, self._rng_radar)
        observation = Observation(t_s, STEP_S, speed, yaw_rate, self._frame(truth.pose_m))
        events: tuple[Event, ...] = ()
        return Sensed(observation, radar, truth, events, self._users.poses_m)

    def _truth(self, t_s: float) -> Truth:
        pose, car, near, k = self._car.pose_m, self._car, self._near, self._column
        here = k >= 0
        beyond = np.maximum(near.distance_m[2:] - 0.5 * self.network.width_m[near.lane], 0.0)
        off = beyond.min(axis=1, initial=9.9)
        if (off > 0.0).any():
            off = np.where(self.ground.in_areas(wheels_m(pose)), 0.0, off)
        inside = here and bool(self.network.is_internal[self._lane])
        worst = float(off.max())
        if here and not inside:
            own = np.isin(near.lane, self.ground.kin(self._lane)) | self.network.is_internal[near.lane]
            aside = np.where(own, beyond, np.inf).min(axis=1)
            if (aside > 0.0).any():
                aside = np.where(self.ground.in_areas(wheels_m(pose)), 0.0, aside)
            worst = float(aside.max())
        heading = float(near.heading_rad[0, k]) if here else math.nan
        return Truth(
            t_s=t_s,
            x_m=pose[0],
            y_m=pose[1],
            heading_rad=pose[2],
            speed_mps=car.speed_mps,
            yaw_rate_radps=car.speed_mps * car.curvature_1pm,
            acceleration_mps2=self._accel_mps2,
            steering_rad=car.steering_rad,
            indicator=self._indicator,
            lane=self._lane,
            lane_id=self.network.lane_ids[self._lane] if here else "",
            lane_position_m=float(near.position_m[0, k]) if here else math.nan,
            offset_m=float(near.offset_m[0, k]) if here else math.nan,
            lane_heading_error_rad=(pose[2] - heading + math.pi) % (2.0 * math.pi) - math.pi,
            wheel_outside_m=worst,
            on_paving=bool((off <= 0.0).all()),
            in_junction=inside,
            driven_m=self._driven_m,
        )

    def _frame(self, pose_m: tuple[float, float, float]) -> Frame | None:
        """The camera's image, if it takes one at this step."""
        if not self._draw:
            return None
        rate = min(self.scenario.camera.rate_hz * STEP_S, 1.0)
        due = math.floor(self._steps * rate + 1e-9) > math.floor((self._steps - 1) * rate + 1e-9) or self._steps == 0
        if not due:
            return None
        if self._renderer is None:
            self._renderer = self._new_renderer()
        pose = np.array([*pose_m, *self._height_and_pitch()])
        users = self._users
        image = self._renderer.render(pose, users.poses_m, users.kinds, users.ids)
        self._frames += 1
        return apply_camera(image, self._drive.conditions, np.random.default_rng([self._seed, self._frames - 1]))

    def _height_and_pitch(self) -> tuple[float, ...]:
        """Height of the road below the rear axle and the pitch of the ego; nothing in a flat town."""
        if self.town.heights_m is None:
            return ()
        rear = self.ground.height_m(self._lane, float(self._near.position_m[0, self._column]) if self._column >= 0 else 0.0)
        ahead = self.ground.near(np.array([ahead_of(self._car.pose_m, WHEELBASE_M)]))
        k = self.ground.lane_of(ahead, 0, self._car.pose_m[2], self._lane)
        front = self.ground.height_m(int(ahead.lane[k]), float(ahead.position_m[0, k])) if k >= 0 else rear
        return rear, math.atan((front - rear) / WHEELBASE_M)

    def _new_renderer(self) -> FrameRenderer:
        from hippodrome.sim.render.renderer import FrameRenderer  # not before a frame is drawn: without frames no GL is needed

        seen: FloatArray = self.network.points_m
        scene = build_scene(self.town, self.scenario.seed, self._drive.conditions, seen)
        return FrameRenderer(scene, self.scenario.camera)
