"""Small towns, and a driver who knows the truth, for the tests of the loop."""

import math

import libsumo

from hippodrome.core.navigation.types import Indicator
from hippodrome.sim.scenario import Scenario
from hippodrome.sim.sumo_tools import run_tool

GRID = {"kind": "grid", "width_m": 150, "height_m": 150, "road_km": 1.0}


def scenario(vehicles=0, noise="paper", town=None, **other):
    return Scenario.model_validate(
        {
            "name": "loop",
            "seed": 3,
            "town": town or GRID,
            "noise": noise,
            "mapping": {"tour": {"length_m": 800}},
            "localization": {"tour": {"length_m": 500}, "traffic": {"vehicles": vehicles}},
            **other,
        }
    )


def keeper(world, sensed, indicator=Indicator.STRAIGHT, speed_mps=6.0, gap_m=3.0):
    """A command that keeps the lane's middle by pure pursuit of the truth, and stands behind whoever is ahead."""
    truth, ground = sensed.truth, world.ground
    reach_m, lane = truth.lane_position_m + 2.5 + 0.4 * truth.speed_mps, truth.lane
    while lane >= 0 and reach_m > ground.lane_length_m(lane):
        reach_m -= ground.lane_length_m(lane)
        lane = next_lane(world, lane, indicator)
    x, y, _ = ground.pose_at(lane, reach_m)
    dx, dy = x - truth.x_m, y - truth.y_m
    cos, sin = math.cos(truth.heading_rad), math.sin(truth.heading_rad)
    forward, left = cos * dx + sin * dy, cos * dy - sin * dx
    curvature = 2.0 * left / (forward**2 + left**2)
    room = max(sensed.radar.gap_m - gap_m, 0.0)
    speed = min(speed_mps, math.sqrt(2.0 / max(abs(curvature), 1e-3)), math.sqrt(3.0 * room) if room < 1e3 else 99.0)
    return min(2.0, 2.0 * (speed - truth.speed_mps)), math.atan(2.7 * curvature)


def next_lane(world, lane, indicator):
    if world.network.is_internal[lane]:
        return int(world.network.successors(lane)[0])
    way = world.ways.meant(lane, indicator)
    return (*way.inside, way.target)[0]


ARMS = {"w": (-120, 0), "e": (120, 0), "n": (0, 120), "s": (0, -120)}


def crossing(folder, kind="priority", lanes=1, hill_m=0.0, options=()):
    """A crossing of four streets with dead ends; the one from w to e has priority. Edges are called w-c, c-e and so on."""
    nodes, edges, net = (folder / f"crossing.{part}.xml" for part in ("nod", "edg", "net"))
    rows = [f'<node id="{n}" x="{x}" y="{y}" z="{hill_m if n == "e" else 0}"/>' for n, (x, y) in ARMS.items()]
    nodes.write_text(f'<nodes><node id="c" x="0" y="0" type="{kind}" radius="6"/>' + "".join(rows) + "</nodes>")
    common = f'numLanes="{lanes}" speed="8.33" width="3.2"'
    rows = [
        f'<edge id="{a}-{b}" from="{a}" to="{b}" priority="{9 if arm in "we" else 1}" {common}/>'
        for arm in ARMS
        for a, b in ((arm, "c"), ("c", arm))
    ]
    edges.write_text("<edges>" + "".join(rows) + "</edges>")
    files = f"--node-files={nodes}", f"--edge-files={edges}", f"--output-file={net}"
    run_tool("netconvert", *files, "--offset.disable-normalization=true", "--no-turnarounds.except-deadend=true", *options)
    return {"network": str(net)}


def car(name, edges, position_m, speed_mps=0.0, standing=False, lane=0):
    """Puts another vehicle on the road, in front of SUMO's position ``position_m``; ``standing``: it never moves."""
    libsumo.route.add(f"route-{name}", edges)
    libsumo.vehicle.add(
        name, f"route-{name}", typeID="kind0", departLane=str(lane), departPos=str(position_m), departSpeed=str(speed_mps)
    )
    if standing:
        libsumo.vehicle.setSpeed(name, 0.0)
