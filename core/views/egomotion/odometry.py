"""Self-motion from the frames of any camera that looks ahead from a vehicle.

Each frame is compared with a reference: the frame before, or an older one as long as the picture has hardly moved since. So a
vehicle that stands does not drift, and one that creeps is not taken to stand. What is told of a frame is the motion since the
reference, less what was told of it already.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from hippodrome.core.types import FloatArray, Observation
from hippodrome.core.views.egomotion import epipolar, road, speed, structure
from hippodrome.core.views.egomotion.camera import RoadCamera, working_image, working_matrix
from hippodrome.core.views.egomotion.static import StaticMap
from hippodrome.core.views.egomotion.tracks import Bools, Grey, follow, new_corners

STILL_PX: Final = 0.12  # median way of the corners below which the vehicle stands
ENOUGH_PX: Final = 1.5  # median way of the corners from which on the next frame is compared with this one
LONGEST_S: Final = 2.0  # a frame that moved is compared with none that is older than this, ..
LEAST_LEFT: Final = 0.5  # .. nor with one of which fewer corners than this share are left
LEAST_CORNERS: Final = 15  # with fewer corners the last motion goes on
LEAST_STEP_M: Final = 0.05  # a shorter step tells no depths ..
HEADING_STEP_M, HEADING_CORNERS = 0.15, 40  # .. and what tells where the vehicle drives to: a step, and corners that agree
LEAST_TOLD: Final = 0.2  # share of it that the corners told rather than what was believed before; that share is its weight
HEADING_MEMORY: Final = 400.0  # pairs of frames over which that is averaged
KNOWN_PAIRS: Final = 60.0  # pairs of frames from which on it is known well
HEADING_PLAY: Final = 5e-4  # tangent by which the horizon has to move before the road is looked for anew
SEARCH_EVERY: Final = 10  # pairs of frames after which all speeds are tried


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """The frame that others are compared with."""

    image: Grey
    corners_px: FloatArray  # (N, 2)
    depth: FloatArray  # (N,) of the corners, in units of the step that led to this frame; NaN: unknown
    depth_sigma: FloatArray  # (N,) relative standard deviation
    step_m: float  # the step that led to this frame


class RoadOdometry:
    """Takes observations in order; each comes back with the speed (m/s) and yaw rate that the frames show in place of its own."""

    def __init__(self, camera: RoadCamera, static: StaticMap | None = None) -> None:
        self._camera = camera
        self._static = static
        self._matrix = camera.matrix
        self._reference: Reference | None = None
        self._since_s, self._told = 0.0, np.zeros(2)  # time since the reference, and motion (m, rad) seen since
        self._blind_s, self._guessed = 0.0, np.zeros(2)  # time since the last frame, and motion told without any
        self._speed, self._yaw_rate_radps = speed.start(), 0.0
        self._heading, self._heading_pairs = camera.heading.copy(), np.full(2, camera.heading_pairs)
        self._patch: road.Patch | None = None
        self._patch_heading = np.full(2, np.inf)
        self._pairs = 0

    def learned(self) -> tuple[RoadCamera, StaticMap | None]:
        """What the frames have shown of the camera so far: where it is driven to (the horizon), and what moves along with it."""
        known = replace(self._camera, heading=self._heading.copy(), heading_pairs=float(self._heading_pairs.min()))
        return known, self._static

    @property
    def knows_camera(self) -> bool:
        """Whether enough frames were seen to know where the camera is driven to."""
        return bool(self._heading_pairs.min() >= KNOWN_PAIRS)

    def step(self, observation: Observation) -> Observation:
        """The observation with the frames' motion.

        Without a frame the motion goes on at the last rates. With one, the true motion since the reference is known, and this
        observation reports what of it has not been reported yet (which may be negative).
        """
        dt_s = observation.dt_s
        self._since_s += dt_s
        self._blind_s += dt_s
        if observation.frame is None:
            step = self._rates() * dt_s
            self._guessed = self._guessed + step
        else:
            seen = self._seen(working_image(observation.frame), observation.frame.shape[1], self._blind_s)
            step, self._blind_s, self._guessed = seen - self._guessed, 0.0, np.zeros(2)
        return replace(observation, speed=float(step[0]) / dt_s, yaw_rate_radps=float(step[1]) / dt_s)

    def _rates(self) -> FloatArray:
        return np.array([self._speed.mps, self._yaw_rate_radps])

    def _seen(self, image: Grey, width_px: int, dt_s: float) -> FloatArray:
        """Motion (m, rad) since the frame before, ``dt_s`` ago."""
        reference = self._reference
        if reference is None or reference.image.shape != image.shape:
            self._matrix = working_matrix(self._camera.matrix, width_px)
            if self._static is None or self._static.mask.shape != image.shape:
                self._static = StaticMap(image)
            self._refer_to(image)
            return self._rates() * dt_s
        told, expected = self._told, self._told + self._rates() * dt_s
        ends_px, found = self._followed(reference, image)
        way_px = float(np.median(np.hypot(*(ends_px - reference.corners_px)[found].T))) if found.any() else 0.0
        if np.count_nonzero(found) < LEAST_CORNERS:
            self._told = expected
            self._speed = speed.carried_on(self._speed, dt_s, None)
            self._refer_to(image)
            return expected - told
        if way_px < STILL_PX:
            self._speed, self._yaw_rate_radps, self._told = speed.standing(dt_s), 0.0, np.zeros(2)
            if found.mean() < LEAST_LEFT:
                self._refer_to(image)
            return -told
        moved = self._compared(reference, image, ends_px, found, dt_s, way_px)
        return moved - told

    def _followed(self, reference: Reference, image: Grey) -> tuple[FloatArray, Bools]:
        """Where the reference's corners are, and which of them were found and do not move along with the camera."""
        ends_px, found = follow(reference.image, image, reference.corners_px, reference.corners_px)
        way_px = np.hypot(*(ends_px - reference.corners_px)[found].T)
        if self._static is not None and len(way_px) and np.quantile(way_px, 0.75) > ENOUGH_PX:
            self._static.learn(reference.image, image)
            at = np.rint(reference.corners_px).astype(int)
            found = found & (self._static.mask[at[:, 1], at[:, 0]] == 0)
        return ends_px, found

    def _refer_to(
        self,
        image: Grey,
        kept_px: FloatArray | None = None,
        depths: tuple[FloatArray, FloatArray] | None = None,
        step_m: float = 0.0,
    ) -> None:
        """Compare with this frame from now on. Of corners kept from the last one the depths are known."""
        assert self._static is not None
        corners = new_corners(image, np.zeros((0, 2)) if kept_px is None else kept_px, self._static.mask)
        depth, sigma = (np.zeros(0), np.zeros(0)) if depths is None else depths
        fresh = len(corners) - len(depth)
        self._reference = Reference(
            image, corners, np.append(depth, np.full(fresh, np.nan)), np.append(sigma, np.ones(fresh)), step_m
        )
        self._since_s, self._told = 0.0, np.zeros(2)

    def _compared(
        self, reference: Reference, image: Grey, ends_px: FloatArray, found: Bools, dt_s: float, way_px: float
    ) -> FloatArray:
        """Motion (m, rad) from the reference to this frame; the frame becomes the reference if it has moved enough."""
        inverse, pixel = np.linalg.inv(self._matrix), 1.0 / float(self._matrix[0, 0])
        before, after = (
            np.column_stack([at_px[found], np.ones(np.count_nonzero(found))]) @ inverse.T
            for at_px in (reference.corners_px, ends_px)
        )
        prior = self._prior(dt_s)
        turned = epipolar.estimate_rotation(before, after, pixel, prior)
        depths = structure.depths(before, after, turned, pixel)
        normal = self._normal()
        believed = speed.carried_on(self._speed, dt_s, self._by_structure(reference, found, depths, dt_s))
        corners = structure.ground_step(before, depths, normal)
        self._speed = self._by_road(reference.image, image, turned, believed, corners, dt_s)
        moved = np.array([self._told[0] + self._speed.mps * dt_s, -float(turned.vector_rad @ normal)])
        self._yaw_rate_radps = float(moved[1] - self._told[1]) / dt_s
        self._learn_heading(turned, prior, float(moved[0]))
        if way_px > ENOUGH_PX or self._since_s > LONGEST_S or found.mean() < LEAST_LEFT:
            kept = turned.inlier
            self._refer_to(image, ends_px[found][kept], (depths.second[kept], depths.sigma[kept]), float(moved[0]))
        else:
            self._told = moved
        return moved

    def _prior(self, dt_s: float) -> epipolar.Prior:
        """What is expected of the motion since the reference."""
        expected_m, expected_rad = self._told + self._rates() * dt_s
        return epipolar.Prior(
            yaw_rad=-expected_rad,
            yaw_sigma_rad=epipolar.TURN_CHANGE_RADPS2 * dt_s * max(dt_s, 0.1) + 0.01,
            tilt_sigma_rad=epipolar.TILT_RADPS * self._since_s,
            heading=self._heading,
            heading_sigma=self._camera.heading_sigma / math.sqrt(1.0 + 4.0 * float(self._heading_pairs.min())),
            swing=0.5 + self._camera.forward_m / max(abs(expected_m), 0.2),
        )

    def _normal(self) -> FloatArray:
        """Unit vector (3,) to the ground: the vehicle drives along the road, so that where it drives to lies on the horizon."""
        normal = np.array([0.0, 1.0, -self._heading[1]])
        unit: FloatArray = normal / np.linalg.norm(normal)
        return unit

    def _by_structure(self, reference: Reference, found: Bools, depths: structure.Depths, dt_s: float) -> speed.Speed | None:
        """The speed as the depths of the corners carry it on; None where they do not."""
        if reference.step_m < LEAST_STEP_M:
            return None
        ratio = structure.step_ratio(reference.depth[found], reference.depth_sigma[found], depths)
        if ratio is None:
            return None
        step_m = ratio[0] * reference.step_m
        return speed.Speed((step_m - self._told[0]) / dt_s, (ratio[1] * step_m / dt_s) ** 2)

    def _by_road(
        self, before: Grey, after: Grey, turned: epipolar.Turned, believed: speed.Speed, corners: float | None, dt_s: float
    ) -> speed.Speed:
        """The believed speed, corrected by the road where it tells something."""
        assert self._static is not None
        if np.abs(self._patch_heading - self._heading).max() > HEADING_PLAY:
            self._patch = road.road_patch(self._matrix, (after.shape[1], after.shape[0]), self._normal())
            self._patch_heading = self._heading.copy()
        if self._patch is None:
            return believed
        height_m, told_m = self._camera.height_m, float(self._told[0])
        self._pairs += 1
        expected = road.Expected(
            step=(told_m + believed.mps * dt_s) / height_m,
            sigma=math.sqrt(believed.variance) * dt_s / height_m,
            longest=speed.FASTEST_MPS * self._since_s / height_m,
            corners=corners,
            search=self._pairs % SEARCH_EVERY == 0,
        )
        weights = road.free_cells(self._static.mask, self._patch)
        found = road.measure_step(before, after, self._patch, weights, self._matrix, turned.rotation, turned.direction, expected)
        if found.sigma < math.inf:
            believed = speed.corrected(believed, found.step * height_m, found.sigma * height_m, dt_s, told_m)
        if found.elsewhere is None:
            return believed
        away_mps = (found.elsewhere * height_m - told_m) / dt_s - believed.mps
        return speed.Speed(believed.mps, believed.variance + away_mps**2)

    def _learn_heading(self, turned: epipolar.Turned, prior: epipolar.Prior, moved_m: float) -> None:
        """Average where the vehicle drives to in the picture, less what its turning adds."""
        if moved_m < HEADING_STEP_M or np.count_nonzero(turned.inlier) < HEADING_CORNERS:
            return
        self._heading_pairs = np.minimum(self._heading_pairs + turned.told, HEADING_MEMORY)
        ahead = np.array([turned.tangents[0] - prior.swing * turned.vector_rad[1], turned.level])
        weight = np.where(turned.told > LEAST_TOLD, 1.0, 0.0) / np.maximum(self._heading_pairs + 0.5, 1.0)
        self._heading = self._heading + weight * (ahead - self._heading)
