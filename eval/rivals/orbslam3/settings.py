"""ORB-SLAM3's settings for a rectified pair of pinhole cameras, in the older format: the newer one crashes for such pairs."""

from __future__ import annotations

from hippodrome.core.types import HippodromeError
from hippodrome.sim.render.camera import CameraSpec

ATLAS = "atlas"  # name of the map file in the working directory; the tracker adds ".osa"
FEATURES = 1200  # per image; the other values of the extractor are those of the published KITTI and EuRoC settings
# Points nearer than so many baselines count as close, and the tracker makes a keyframe when it tracks too few of them. On 400 s
# of the paper's drive, 60 gives 1,320 keyframes and 90 gives 885 for 22 % less CPU, as the cost of a global bundle adjustment
# grows with the keyframes. What it means for accuracy is in docs/baselines.md.
CLOSE_BASELINES = 90.0
VIEWER = {
    "KeyFrameSize": 0.05,
    "KeyFrameLineWidth": 1.0,
    "GraphLineWidth": 0.9,
    "PointSize": 2.0,
    "CameraSize": 0.08,
    "CameraLineWidth": 3.0,
    "ViewpointX": 0.0,
    "ViewpointY": -0.7,
    "ViewpointZ": -1.8,
    "ViewpointF": 500.0,
}


def settings_text(camera: CameraSpec, localize: bool = False) -> str:
    """The settings file in OpenCV's dialect of YAML, for a pinhole camera without distortion.

    Args:
        camera: The stereo camera.
        localize: Whether a map is loaded in order to localize in it; otherwise the map is saved at the end.

    Raises:
        HippodromeError: The camera is not a stereo camera.
    """
    if camera.stereo_baseline_m is None:
        raise HippodromeError("ORB-SLAM3: camera.stereo_baseline_m is not set, a stereo pair needs a baseline")
    focal_px = camera.focal_px()
    values: dict[str, object] = {
        "Camera.type": '"PinHole"',
        "Camera.fx": focal_px,
        "Camera.fy": focal_px,
        "Camera.cx": camera.width / 2.0 - 0.5,
        "Camera.cy": camera.height / 2.0 - 0.5,
        **{f"Camera.{name}": 0.0 for name in ("k1", "k2", "p1", "p2")},
        "Camera.bFishEye": 0,
        "Camera.width": camera.width,
        "Camera.height": camera.height,
        "Camera.fps": round(camera.rate_hz),
        "Camera.bf": focal_px * camera.stereo_baseline_m,
        "Camera.RGB": 1,
        "ThDepth": CLOSE_BASELINES,
        "ORBextractor.nFeatures": FEATURES,
        "ORBextractor.scaleFactor": 1.2,
        "ORBextractor.nLevels": 8,
        "ORBextractor.iniThFAST": 20,
        "ORBextractor.minThFAST": 7,
        f"System.{'Load' if localize else 'Save'}Atlas{'From' if localize else 'To'}File": f'"{ATLAS}"',
        **{f"Viewer.{name}": value for name, value in VIEWER.items()},
    }
    return "%YAML:1.0\n" + "".join(f"{name}: {value}\n" for name, value in values.items())
