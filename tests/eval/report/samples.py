"""A small run with everything that a page shows: two towns, one of which is hostile and has results only."""

import cv2
import numpy as np

from hippodrome.eval.report.belief import AS_PRINTED
from hippodrome.eval.results.model import LocalizationSummary, Results, Row, write_results
from tests.eval.report.test_player import second_drive
from tests.eval.report.test_report import HOSTILE, evidence, scenario

SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="90" height="60"><rect width="90" height="60" fill="#d55e00"/></svg>'


def write_run(folder):
    """Results and the files beside them."""
    lost = LocalizationSummary(definition="d", success=False, false_fixes=2, localized_share=0.5)
    towns = (scenario("town & co", as_printed=Row(method=AS_PRINTED, localization=lost)), scenario(HOSTILE))
    write_results(folder / "results.json", Results(scenarios=towns))
    town = folder / "town & co"
    town.mkdir()
    picture = np.full((60, 90, 3), 200, np.uint8)
    for name in ("maps", "frames"):
        cv2.imwrite(str(town / f"{name}.png"), picture)
    (town / "maps.svg").write_text(SVG)
    for name in ("thumbnails.jpg", "frames-second.jpg"):
        cv2.imwrite(str(town / name), np.full((24, 32, 3), 90, np.uint8))
    (town / "map.json").write_text(evidence().model_dump_json())
    (town / "belief.json").write_text(second_drive().model_dump_json())
