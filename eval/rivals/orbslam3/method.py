"""ORB-SLAM3 as the protocol has it, and what is its own: its packages, its vocabulary, the files that it leaves."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import ClassVar, Final

from pydantic import BaseModel

from hippodrome._files import write_atomically
from hippodrome.core.types import Observation
from hippodrome.eval.methods.method import ORBSLAM3
from hippodrome.eval.methods.protocol import Given, Localized, Mapped, MethodError, Needs
from hippodrome.eval.programs.camera_poses import read_camera_tum
from hippodrome.eval.programs.environments import Environment, user_cache
from hippodrome.eval.programs.stream import StreamLocalizer
from hippodrome.eval.rivals.orbslam3.settings import ATLAS, settings_text
from hippodrome.eval.rivals.orbslam3.training import VocabularyTask, train_vocabulary
from hippodrome.proto import method_stream_pb2
from hippodrome.sim.method_spec import MethodSpec

# The wheels of CPython 3.11, 3.12 and 3.13 on x86_64; there are no others of the tracker. NumPy and protobuf have the versions of
# constraints.txt.
ENVIRONMENT: Final = Environment("orb-slam3", """\
pyorbslam3==0.1.1 \\
    --hash=sha256:dbbc0ae582b0aec75dd02935b19873dce23c3899e25ee358d58b66c80ea81288 \\
    --hash=sha256:5566ee8a36bbc262dd62f8d27256d4b19d9ea54ad8beb9e16c93ae544f7c1746 \\
    --hash=sha256:daa786c8dcd86122bdbf1072733fa1ac5a7b306e220de25580c932662b994be0
numpy==2.4.6 \\
    --hash=sha256:89cd468399cfd2504718f0ba50e410dca55a170b61a02ad92bb18c8a65186e93 \\
    --hash=sha256:90f9849678c75fe7afa2d348ac842c168b0a4d3d61919687216dfc547976d853 \\
    --hash=sha256:a7830bab239b79cda9c08c2da014761cafb48da6150e1da17ac06283f43b6089
protobuf==7.36.2 \\
    --hash=sha256:89f23aa53c24553a2416fd4fd1ec06f74fa42b14b546d8883128813f775bbfd2
""", "pyorbslam3")  # fmt: skip
RUNNER: Final = Path(__file__).with_name("runner.py")
# Time that a run may take: so much, and so much per frame. A frame takes 0.07 s on a free core, so ten times that is a hang.
LIMIT_BASE_S: Final = 300.0
LIMIT_PER_FRAME_S: Final = 0.8
STALL_S: Final = 120.0  # its threads wait for one another now and then, late in a long drive
MEMORY_MB: Final = 24_000  # it takes up to 9 GB, when global bundle adjustments overlap late in a long drive
NEW_MAP: Final = "New Map created"  # line of the log: at the start, and whenever it gave up looking for where it was


class OrbSlam3:
    """Binocular ORB-SLAM3, fed over the stream."""

    card: ClassVar = ORBSLAM3
    frame: ClassVar = ORBSLAM3.frame
    label: ClassVar = ORBSLAM3.label
    needs: ClassVar = Needs(stereo=True, size_px=(640, 480), grain=True)
    takes_bytes: ClassVar = 7_000_000_000  # of memory: up to 6.6 GB late in the paper's drive

    class Config(BaseModel):
        """How it is run."""

        vocabulary: Path | None = None  # None: one is trained on other towns, made once and kept in the user's cache
        paced: bool = False  # frames are tracked at the camera's rate, not as fast as they come
        time_limit_s: float | None = None  # for a drive; None: by the number of its frames

    def __init__(self, config: Config | None = None) -> None:
        self.config = config or self.Config()

    @staticmethod
    def install() -> None:
        """Make its environment, if that is not there yet. Raises MethodError where that cannot be."""
        ENVIRONMENT.python()

    def map(self, observations: Iterator[Observation], given: Given) -> Mapped:
        """Its trajectory after all optimisation, and that on the way. Raises MethodError if it did not end well."""
        mapped = self._program(given, given.folder, localize=False).map(observations, given)
        if mapped.live is None or not (given.folder / "final.tum").exists():
            raise MethodError("it never found its place, and made no map")
        ahead_m = given.camera.forward_m
        log = (given.folder / "log.txt").read_text(errors="replace")
        figures = {
            "keyframes": len(read_camera_tum(given.folder / "keyframes.tum", ahead_m).t_s),
            "maps_started": log.count(NEW_MAP),
        }
        atlas = given.folder / f"{ATLAS}.osa"
        own = json.loads((given.folder / "own.json").read_text(encoding="utf-8"))
        assert mapped.cost is not None
        return replace(
            mapped,
            trajectory=read_camera_tum(given.folder / "final.tum", ahead_m),
            state=given.folder,
            figures=figures,
            save=lambda _: atlas.stat().st_size,  # it stays where it is, as it takes half a gigabyte
            cost=replace(mapped.cost, **own),
        )

    def localize(self, observations: Iterator[Observation], given: Given) -> Localized:
        """Its answers in the frame of its own map; it stands by those that it tracked in that map."""
        assert given.mapped is not None
        folder = given.folder / "localizing"
        folder.mkdir(exist_ok=True)
        link = folder / f"{ATLAS}.osa"
        link.unlink(missing_ok=True)
        link.symlink_to((given.mapped.state / link.name).absolute())
        return self._program(given, folder, localize=True).localize(observations, given)

    def _program(self, given: Given, folder: Path, localize: bool) -> StreamLocalizer:
        """The tracker as a program of the stream, with its settings in a folder."""
        settings = folder / "settings.yaml"
        write_atomically(settings, settings_text(given.camera, localize).encode())
        limit_s = LIMIT_BASE_S + given.duration_s * (given.camera.rate_hz * LIMIT_PER_FRAME_S + self.config.paced)
        words = [ENVIRONMENT.python(), RUNNER.absolute(), method_stream_pb2.__file__, self._vocabulary(given).absolute()]
        words += [settings.absolute(), folder.absolute(), *(["paced"] if self.config.paced else [])]
        command = shlex.join(map(str, words))
        time_limit_s = self.config.time_limit_s or limit_s
        spec = MethodSpec(
            stream=command, localize=command, time_limit_s=time_limit_s, stall_limit_s=STALL_S, memory_limit_mb=MEMORY_MB
        )
        return StreamLocalizer(spec)

    def _vocabulary(self, given: Given) -> Path:
        if self.config.vocabulary is not None:
            return self.config.vocabulary
        return train_vocabulary(VocabularyTask(given.camera, given.seed, user_cache() / "hippodrome"))
