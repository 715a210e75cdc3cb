"""How many other road users there are. ``sim/traffic.py`` says what they look like and where they drive."""

from __future__ import annotations

from pydantic import Field

from hippodrome.sim.spec import Spec


class TrafficSpec(Spec):
    """Background traffic."""

    vehicles: int = Field(20, ge=0, le=1000)  # on the road at the same time, as far as they find room
