"""The model of the compiled search: lane graph, scales and costs as named tuples of arrays, which numba takes."""

from __future__ import annotations

from typing import NamedTuple

from numba import njit

from hippodrome.core.roads.lane_graph import BinGrid
from hippodrome.core.roads.lanes_ahead import LanesAhead
from hippodrome.core.types import Float32Array, FloatArray, IntArray


class GraphTables(NamedTuple):
    """N bins of lanes, and the lanes ahead of each lane."""

    ahead: LanesAhead
    heading_rad: Float32Array  # (N,) driving direction in each bin
    lane: IntArray  # (N,) lane of each bin
    position_m: FloatArray  # (N,) arc length of its centre on the lane
    points_m: FloatArray  # (N, 2) centre of each bin


class StepCosts(NamedTuple):
    """Costs of one step on the network; see ``SearchCosts``."""

    heading_sigma_rad: float
    heading_limit_nats: float  # a heading error, or a distance from the place prior, costs at most this
    offset_gain: float  # share of a heading error that the carried heading offset takes over
    half_bin_m: float
    length_sigma_m: float
    scale_step_nats: float  # cost of a change of scale, for each scale bin
    scale_jump_nats: float  # most that a change of scale costs
    lane_change_nats: float


class OffNetworkModel(NamedTuple):
    """Costs of leaving the network, of driving off it, and of coming back; see ``OffNetworkCosts``."""

    grid: BinGrid  # where the bins are
    return_nats: float
    drift: float
    turn_limit_rad: float
    leave_nats: float
    step_nats: float
    spread_nats: float


class SearchModel(NamedTuple):
    """All that the compiled search needs apart from the drive."""

    scales: FloatArray  # (K,) metres per map unit
    graph: GraphTables
    costs: StepCosts
    off_network: OffNetworkModel


class Drive(NamedTuple):
    """T samples of the drive, ``step`` map units apart."""

    heading_rad: FloatArray  # (T,) by odometry
    place_prior: FloatArray  # (T, 3) x, y and 1/sigma^2 of what is known of the place at each sample; 0: nothing is known
    step: float


class StepObservation(NamedTuple):
    """What is known of the step that ends at one sample."""

    heading_rad: float  # by odometry, at the step's end
    course_rad: float  # mean heading on the way
    step: float  # length, map units
    x_m: float  # known place at the step's end
    y_m: float
    place_weight: float  # 1/sigma^2 of the known place; 0: none is known


@njit(cache=True, error_model="numpy")
def observation_of_step(drive: Drive, t: int) -> StepObservation:
    """What odometry and the place prior tell of the step from sample ``t - 1`` to ``t``."""
    heading, place = drive.heading_rad, drive.place_prior
    return StepObservation(heading[t], 0.5 * (heading[t - 1] + heading[t]), drive.step, place[t, 0], place[t, 1], place[t, 2])
