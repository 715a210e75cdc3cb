"""Reading the road in single frames: the lane's borders and the line at which it ends."""

from hippodrome.core.reading.config import ReaderConfig
from hippodrome.core.reading.reader import RoadReader
from hippodrome.core.reading.types import LaneEnd, RoadReading

__all__ = ["LaneEnd", "ReaderConfig", "RoadReader", "RoadReading"]
