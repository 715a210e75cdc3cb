"""Light, weather, season and camera effects of a drive, in numbers. They change colours only: the geometry of a town stays."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from hippodrome.sim.spec import Spec


class Conditions(Spec):
    """The defaults are a clear summer day and a perfect camera."""

    sun_azimuth_deg: float = Field(default=210.0, ge=-360.0, le=360.0)  # where the sun stands, counter-clockwise from x (east)
    sun_elevation_deg: float = Field(default=45.0, ge=2.0, le=90.0)
    overcast: float = Field(default=0.0, ge=0.0, le=1.0)  # 0 clear sky, 1 closed cloud
    dusk: float = Field(default=0.0, ge=0.0, le=1.0)  # 0 day, 1 after sunset with lit windows
    fog_visibility_m: float | None = Field(default=None, ge=10.0, le=50_000.0)  # meteorological visibility
    season: Literal["summer", "autumn", "winter"] = "summer"
    gain: float = Field(default=1.0, gt=0.0, le=8.0)
    gamma: float = Field(default=1.0, ge=0.2, le=5.0)
    noise_sigma: float = Field(default=0.0, ge=0.0, le=64.0)  # of each pixel and channel, in 8-bit levels
    motion_blur: float = Field(default=0.0, ge=0.0, le=0.2)  # length of the horizontal smear as a share of the frame's width
