"""Options that several commands have for drives of others: their truth, and values that argparse is to check."""

from __future__ import annotations

import argparse
from pathlib import Path

from hippodrome.eval.commands.arguments import number_or_nan


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
        "--truth-sigma", type=above_zero, metavar="M",
        help="accuracy of the truth: standard deviation along one axis, metres (default: as the file says)",
    )  # fmt: skip


def above_zero(text: str) -> float:
    """A finite number above 0."""
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not a number above 0")
    return value


def offset(text: str) -> float | str:
    """Seconds to add to a clock, or ``auto``."""
    if text == "auto":
        return text
    value = number_or_nan(text)
    if not abs(value) <= 1e11:
        raise argparse.ArgumentTypeError(f"'{text}' is neither auto nor a number of seconds")
    return value


def ahead(text: str) -> float | str:
    """Metres ahead of the rear axle, or ``auto``."""
    return text if text == "auto" else metres_ahead(text, "auto or ")


def metres_ahead(text: str, or_else: str = "") -> float:
    """Metres ahead of the rear axle; ``or_else`` is what an option takes as well."""
    value = number_or_nan(text)
    if not abs(value) <= 1e4:
        raise argparse.ArgumentTypeError(f"'{text}' is not {or_else}a number from -10000 to 10000")
    return value


def rate(text: str) -> float:
    """A rate or a height, from 0.01 to 10000."""
    value = number_or_nan(text)
    if not 0.01 <= value <= 10_000.0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number from 0.01 to 10000")
    return value


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
