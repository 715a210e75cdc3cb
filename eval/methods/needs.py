"""Whether a drive has what a method needs of it, and what is to be done if not."""

from __future__ import annotations

from typing import Final

from hippodrome.eval.methods.beforehand import UNITS
from hippodrome.eval.methods.protocol import MethodError, Needs
from hippodrome.sim.recording import Recording
from hippodrome.sim.render.camera import CameraSpec
from hippodrome.sim.scenario import Scenario

KNOWN_UNIT: Final = "noise.units_per_metre_spread: 0"


def camera_of(scenario: Scenario, drive: Recording) -> CameraSpec:
    """The camera of a drive: the scenario's, or what is known of that of a drive that was recorded elsewhere."""
    known = getattr(drive, "manifest", {}).get("camera", {})
    own = {"stereo_baseline_m": None} if is_foreign(drive) else {}
    return scenario.camera.model_copy(
        update={**own, **{name: value for name, value in known.items() if name in CameraSpec.model_fields}}
    )


def is_foreign(drive: Recording) -> bool:
    """Whether a drive was recorded elsewhere and imported."""
    return "imported" in getattr(drive, "manifest", {})


def has_frames(drive: Recording) -> bool:
    """Whether a drive has any frame: one that was imported as bare odometry has none."""
    return getattr(drive, "frame_count", 1) > 0


def metres_per_unit(scenario: Scenario, drive: Recording) -> float | None:
    """Length of the unit of a drive's speeds in metres; None if nobody can know it.

    It is known of a drive that was imported with it, and of a simulated one whose scenario lets it vary with no drive.
    """
    if is_foreign(drive):
        stated = drive.manifest.get(UNITS)
        return None if stated is None else float(stated)
    noise = scenario.self_motion_noise
    return 1.0 / noise.units_per_metre if noise.units_per_metre_spread == 0.0 else None


def require_met(needs: Needs, scenario: Scenario, drive: Recording) -> None:
    """Raise MethodError, with the cause and the cure, unless a drive has what a method needs of it."""
    if needs.camera and not needs.frames_optional and not has_frames(drive):
        raise MethodError("it needs frames, and the drive has none; import it with the frames of its camera")
    camera, foreign = camera_of(scenario, drive), is_foreign(drive)
    if needs.stereo and camera.stereo_baseline_m is None:
        cure = "use a drive of ours for it" if foreign else "set camera.stereo_baseline_m in the scenario, to 0.5 say"
        raise MethodError(f"it needs stereo pairs, and the drive's camera takes single frames; {cure}")
    if needs.size_px is not None and (camera.width < needs.size_px[0] or camera.height < needs.size_px[1]):
        least = f"{needs.size_px[0]}x{needs.size_px[1]}"
        cure = "import the drive with larger frames" if foreign else "set camera.width and camera.height in the scenario"
        raise MethodError(f"it needs frames of at least {least}, and the drive has {camera.width}x{camera.height}; {cure}")
    if needs.grain and not camera.grain and not foreign:  # what a real camera took has its grain
        raise MethodError("it needs frames with grain, and the drive was drawn without; set camera.grain: true in the scenario")
    if needs.metric_scale and metres_per_unit(scenario, drive) is None:
        why = "nobody stated this drive's" if foreign else "this drive's is drawn at random, as a single camera's is"
        cure = "import it with --units" if foreign else f"set {KNOWN_UNIT} in the scenario, its other errors beside it"
        raise MethodError(f"it needs speeds whose unit is known, and {why}; {cure}")
