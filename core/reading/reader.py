"""Reading the road in one frame."""

from __future__ import annotations

import math
from typing import Final

import cv2
import numpy as np

from hippodrome.core.reading.arcs import GRADE, best_arc, fit_arc, line_places
from hippodrome.core.reading.config import ReaderConfig
from hippodrome.core.reading.dashes import NO_PAINT, SHARPEST_1PM, paint_along_borders
from hippodrome.core.reading.ends import stop_line, strip_levels
from hippodrome.core.reading.ground import Ground, ground_of
from hippodrome.core.reading.lane import Lines, Place, beside_the_axle, edge_probability, heading_variance_rad2, place_in_lane
from hippodrome.core.reading.memory import Memory
from hippodrome.core.reading.mouth import line_end
from hippodrome.core.reading.ridges import find_ridges, trust_of
from hippodrome.core.reading.traits import line_traits
from hippodrome.core.reading.types import LaneEnd, RoadReading
from hippodrome.core.types import Float32Array, Frame, UInt8Array
from hippodrome.core.views.egomotion.camera import RoadCamera

LEAST_RIDGES: Final = 8  # fewer tell of no road
SOLID_ODDS: Final = 2.0  # log odds that a line is the road's edge, from which on its end is told
LEAST_ROWS: Final = 12  # frames that show the road in fewer rows are of no use


class RoadReader:
    """Reads the lane in frames of one camera.

    Between frames it keeps the width of the lanes that it has seen, and the borders that it has passed."""

    def __init__(self, camera: RoadCamera, config: ReaderConfig | None = None) -> None:
        self._camera, self._config = camera, config or ReaderConfig()
        self._ground: Ground | None = None
        self._size_px = (0, 0)
        self._memory = Memory()
        self._width_m, self._width_sigma_m = self._config.lane_width_m, self._config.lane_width_sigma_m
        self._grey: Float32Array | None = None  # the rows of the last frame that show the road

    def read(self, frame: Frame, moved_m: float = math.nan, turned_rad: float = math.nan) -> RoadReading:
        """What the frame (H, W, 3) RGB or (H, W) grey says; variances are ``inf`` for all that is not seen.

        With how far the vehicle went since the frame before (m, a tenth more or less does no harm) and turned (rad, to the
        left), what was seen ahead then tells of the place where the rear axle is now. Without, each frame stands alone.
        """
        ground = self._ground_of(frame)
        self._memory.move(moved_m, turned_rad)
        if len(ground.rows) < LEAST_ROWS:
            return RoadReading()
        self._memory.out_of_sight(ground, self._camera.forward_m)
        self._grey = grey = self._road(frame, ground)
        lines = self._lines(grey, ground)
        place = None
        if lines is not None:
            place = place_in_lane(lines, self._width_m, self._width_sigma_m, self._memory.edges, self._config)
        if lines is None or place is None or place.variance_m2 > self._config.largest_sigma_m**2:
            return RoadReading()
        self._remember(lines, place)
        if not beside_the_axle(lines, place, self._memory.told_m):
            return RoadReading()
        end = self._end(grey, ground, lines, place)
        return RoadReading(
            end_m=end[0],
            end_variance_m2=end[1],
            end=end[2],
            offset_m=-place.middle_m,
            offset_variance_m2=place.variance_m2,
            heading_rad=-float(lines.arc[0]),
            heading_variance_rad2=heading_variance_rad2(lines),
            curvature_1pm=float(lines.arc[1]),
            curvature_variance_1pm2=GRADE**2 * float(lines.covariance[1, 1]),
            lane_width_m=place.width_m,
            curvature_change_1pm2=float(lines.arc[2]),
            left_edge=edge_probability(place, 1),
            right_edge=edge_probability(place, -1),
        )

    def paint(self, reading: RoadReading) -> UInt8Array:
        """The paint (2, PLACES) along both borders in the frame that was read last, of which ``reading`` is what it said.

        It is 0 where no lane was seen, and in sharp bends, where borders are not where the lane's middle has them.
        """
        if self._grey is None or self._ground is None or not reading.sees_lane or abs(reading.curvature_1pm) > SHARPEST_1PM:
            return NO_PAINT
        arc = np.array([-reading.heading_rad, reading.curvature_1pm, reading.curvature_change_1pm2])
        return paint_along_borders(self._grey, self._ground.x_m, self._ground.y_m, arc, -reading.offset_m, self._width_m)

    def _ground_of(self, frame: Frame) -> Ground:
        size_px = frame.shape[1], frame.shape[0]
        if self._ground is None or size_px != self._size_px:
            self._size_px = size_px
            self._ground = ground_of(self._camera, size_px, self._config.far_m, self._config.paint_m)
        return self._ground

    def _road(self, frame: Frame, ground: Ground) -> Float32Array:
        """Brightness (R, W) of the rows that show the road, from the nearest on."""
        first, last = int(ground.rows[-1]), int(ground.rows[0])
        part = frame[first : last + 1]
        grey = part if part.ndim == 2 else cv2.transform(part, np.full((1, 3), 1.0 / 3.0, np.float32))
        return np.ascontiguousarray(grey[::-1], dtype=np.float32)

    def _lines(self, grey: Float32Array, ground: Ground) -> Lines | None:
        """The lines along the road."""
        ridges = find_ridges(grey, ground.x_m, ground.y_m, self._config.line_m)
        trust = trust_of(ridges) if len(ridges) > 0 else np.zeros(0)
        ridges, weight = np.concatenate([ridges, self._memory.ridges]), np.concatenate([trust, self._memory.trust])
        if len(ridges) < LEAST_RIDGES:
            return None
        arc = best_arc(ridges, weight)
        places = line_places(ridges, weight, arc)
        if len(places) == 0:
            return None
        arc, covariance, places, about, owner = fit_arc(ridges, weight, arc, places)
        keep = about[:, 0] > 0.0
        if not np.all(keep):
            return None
        traits = line_traits(grey, ground.x_m, ground.y_m, ridges, owner, arc, places)
        return Lines(arc, covariance, places, about, traits, ridges, weight, owner)

    def _end(self, grey: Float32Array, ground: Ground, lines: Lines, place: Place) -> tuple[float, float, LaneEnd]:
        """Distance of the lane's end, its variance, and what it is."""
        width_m = place.width_m if math.isfinite(place.width_m) else self._width_m
        levels, along_m = strip_levels(grey, ground.x_m, ground.y_m, lines.arc, place.middle_m, width_m)
        paint = float(np.median(lines.ridges[lines.ridges[:, 4] >= 0, 3])) if np.any(lines.ridges[:, 4] >= 0) else 0.0
        line = stop_line(levels, along_m, self._camera.forward_m, paint, self._config.stop_line_m)
        if line[1] < math.inf:
            return line[0], line[1], LaneEnd.STOP_LINE
        best = math.nan, math.inf
        for k, side in ((place.left, 1), (place.right, -1)):
            if k >= 0 and place.edges[side] > SOLID_ODDS:
                at = float(lines.places_m[k])
                found = line_end(
                    grey, ground.x_m, ground.y_m, lines.ridges, lines.owner, k, lines.arc, at, self._camera.forward_m
                )
                best = found if found[1] < best[1] else best
        if best[1] < math.inf and self._memory.is_next(best[0]):
            return best[0], best[1], LaneEnd.MOUTH
        return math.nan, math.inf, LaneEnd.NOTHING

    def _remember(self, lines: Lines, place: Place) -> None:
        of_border = (lines.owner >= 0) & np.isin(lines.owner, [place.left, place.right])
        self._memory.keep(lines.ridges[of_border], lines.trust[of_border])
        self._memory.edges = place.edges
        if math.isfinite(place.width_m):
            self._width_m += 0.05 * (place.width_m - self._width_m)
            self._width_sigma_m = max(0.08, 0.98 * self._width_sigma_m)
