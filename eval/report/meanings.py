"""What each head of the tables means, in plain English for somebody who has not read the paper."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from hippodrome.eval.report.markup import Html, element

MEANINGS: Final = {  # by the begin of a head, without its unit; of several that fit, the longest
    "APE": "how far the map puts the car from its true place, in metres, in the mean over the vertices of the first drive. "
           "Maps without roads are first laid on the true starting pose, and not scaled; those on the roads stay where they lie",
    "APE SE(2)": "the APE after the whole map was moved and turned to fit the truth best: shape and scale are left",
    "APE Sim(2)": "the APE after the whole map was moved, turned and scaled to fit the truth best: shape is left",
    "APE median": "the APE that half of the vertices stay below",
    "APE p95": "the APE that 95 of 100 vertices stay below",
    "APE max": "the APE of the worst vertex",
    "APE of the runs": "the least and the largest mean APE of several runs of the same method",
    "RPE": "how wrong the step from one vertex to the next is (about 5 m), in metres, in the mean",
    "RPE 20 m": "how wrong the way between two vertices 20 m apart is, in metres, in the mean",
    "CPU": "the time that one processor core was busy, as a share of the time that the drive took; 100 is one core all the time",
    "Map": "the size of the stored map",
    "Peak RSS": "the most memory that the process held",
    "Frames": "the camera frames of the drive",
    "Keyframes": "the frames that were kept",
    "Vertices": "the places that the map consists of",
    "Edges": "the links between the map's places: one along the drive for each place, and one for each loop that was closed",
    "Latency median": "how long a step takes; half of the steps are faster",
    "Latency p99": "how long a step takes; 99 of 100 are faster",
    "Places right": "the share of frames for which the first view proposed shows the same place",
    "Places recalled": "the share of frames recognised while 99 of 100 recognitions are right",
    "Covered": "the share of the drive for which the method gave an answer",
    "Success": "whether the second drive was localized from an unknown start, and lay within 20 m of the truth as it said so",
    "Error": "how far the believed place is from the true one, in the mean over the steps that were declared localized, from the "
             "first declaration within 20 m of the truth on; steps in doubt are left out",
    "Error p95": "the error that 95 of 100 of the same steps stay below",
    "First fix": "how long, and how far, the second drive went until it was first declared localized within 20 m of the truth",
    "First fix (s driven)": "how long the second drive took until it was first declared localized within 20 m of the truth",
    "First fix (m driven)": "how far the second drive went until it was first declared localized within 20 m of the truth",
    "CPU of the first fix": "the computing time from the first frame to the first fix, without loading the map",
    "Localized": "the share of all steps of the second drive that were declared localized",
    "False fixes": "separate stretches of steps that were declared localized more than 20 m away from the truth",
}  # fmt: skip


def meaning_of(head: str) -> str | None:
    """The meaning of a head of a table, with or without its unit in brackets; None for one that speaks for itself."""
    fitting = [name for name in MEANINGS if head == name or head.startswith(f"{name} (")]
    return MEANINGS[max(fitting, key=len)] if fitting else None


def meanings(heads: Sequence[str]) -> Html:
    """A list of heads with their meanings, which the tables' heads show when they are tapped."""
    known = [(head, words) for head in dict.fromkeys(heads) if (words := meaning_of(head)) is not None]
    lines = [element("li", element("strong", head), f": {words}.", data_head=head) for head, words in known]
    return element("ul", lines, class_="meanings")
