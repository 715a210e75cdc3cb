"""Options that several commands have for drives of others: their truth, and values that argparse is to check."""

from __future__ import annotations

import argparse
from pathlib import Path

from hippodrome.eval.commands.arguments import number_within, positive_number


def add_truth(parser: argparse.ArgumentParser, default: str) -> None:
    """The truth as a file, its projection and its accuracy."""
    parser.add_argument(
        "--truth", type=Path, metavar="FILE",
        help="true poses (.tum), or fixes: GPX, CSV with the columns t_s, lat, lon, NMEA, GeoJSON, the folder of OXTS data "
             f"(default: {default})",
    )  # fmt: skip
    parser.add_argument(
        "--network", type=Path, metavar="NET.net.xml[.gz]",
        help="the road network into whose frame fixes are projected, so that a topometric map is scored as it lies (default: a "
             "plane of their own)",
    )  # fmt: skip
    parser.add_argument(
        "--truth-sigma", type=positive_number, metavar="M",
        help="accuracy of the truth: standard deviation along one axis, metres (default: as the file says)",
    )  # fmt: skip


def offset(text: str) -> float | str:
    """Seconds to add to a clock, or ``auto``."""
    return text if text == "auto" else seconds(text, "neither auto nor a number of seconds")


def seconds(text: str, what: str = "not a number of seconds") -> float:
    """Seconds to add to a clock."""
    return number_within(text, -1e11, 1e11, what)


def ahead(text: str) -> float | str:
    """Metres ahead of the rear axle, or ``auto``."""
    return text if text == "auto" else metres_ahead(text, "auto or ")


def metres_ahead(text: str, or_else: str = "") -> float:
    """Metres ahead of the rear axle; ``or_else`` is what an option takes as well."""
    return number_within(text, -1e4, 1e4, f"not {or_else}a number from -10000 to 10000")


def rate(text: str) -> float:
    """A rate or a height, from 0.01 to 10000."""
    return number_within(text, 0.01, 10_000.0, "not a number from 0.01 to 10000")


def size(text: str) -> tuple[int, int]:
    """``WxH`` in pixels."""
    width, x, height = text.partition("x")
    try:
        size = int(width), int(height)
    except ValueError:
        size = (0, 0)
    if not x or not all(16 <= side <= 8192 for side in size):
        raise argparse.ArgumentTypeError(f"'{text}' is not WxH in pixels, 16 to 8192 each")
    return size
