"""Does off-screen OpenGL work here? If not, which system package is missing? Installs it where that is possible.

``python -m hippodrome.sim.render.probe [--install]``: exit 0 when a frame was drawn, 2 when not.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from hippodrome._processes import dying_with_me
from hippodrome.core.types import HippodromeError

# Debian and Ubuntu names of what PyOpenGL's EGL platform loads, and of Mesa's software rasteriser behind it.
LIBRARIES: Final = {"libEGL.so.1": "libegl1", "libGL.so.1": "libgl1"}
DRIVER_PACKAGES: Final = ("libegl-mesa0", "libgl1-mesa-dri")
TIMEOUT_S: Final = 120.0  # a first import from a cold disk takes seconds; a driver that hangs must not hang us
DRAWN: Final = "drawn by "
TRIAL: Final = (sys.executable, "-m", "hippodrome.sim.render.probe", "--draw")


def draw() -> str:
    """Draw one frame in this process and name the driver; raises whatever goes wrong."""
    from hippodrome.sim.render.gl import gl, pyrender

    offscreen = pyrender.OffscreenRenderer(16, 16)
    scene = pyrender.Scene(bg_color=[1.0, 0.0, 0.0, 1.0])
    scene.add(pyrender.PerspectiveCamera(yfov=1.0))
    colour, _ = offscreen.render(scene, flags=pyrender.RenderFlags.FLAT)
    if tuple(colour[8, 8]) != (255, 0, 0):
        raise RuntimeError(f"the driver drew {tuple(colour[8, 8])} for red")
    name = gl.glGetString(gl.GL_RENDERER).decode()
    offscreen.delete()
    return str(name)


def probe() -> tuple[bool, str]:
    """Whether a frame can be drawn, tried in a process of its own, and one line: the driver, or what is missing."""
    with _trial() as child:
        return _answer(child)


@contextmanager
def _trial() -> Iterator[subprocess.Popen[str]]:
    """A process that draws one frame; it ends with the block at the latest."""
    with subprocess.Popen(
        TRIAL, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=dying_with_me()
    ) as child:
        try:
            yield child
        finally:
            child.kill()  # nothing happens to one that has ended


def _answer(child: subprocess.Popen[str]) -> tuple[bool, str]:
    """What came of a trial, which is waited for."""
    try:
        out, complaint = child.communicate(timeout=TIMEOUT_S)
    except subprocess.TimeoutExpired:
        return (
            False,
            f"OpenGL does not answer within {TIMEOUT_S:.0f} s; check the graphics driver, and whether the machine is very busy",
        )
    answer = [line.removeprefix(DRAWN) for line in out.splitlines() if line.startswith(DRAWN)]
    if child.returncode == 0 and answer:
        return True, answer[-1]
    reason = (complaint.strip().splitlines() or [f"exit status {child.returncode}"])[-1]
    return False, f"no off-screen OpenGL: {advice()} ({reason})"


def missing_packages() -> tuple[str, ...]:
    """Packages of the libraries that cannot be loaded; the driver's when all of them can."""
    absent = tuple(package for library, package in LIBRARIES.items() if not _loads(library))
    return absent + DRIVER_PACKAGES if absent else DRIVER_PACKAGES


def advice() -> str:
    platform = os.environ.get("PYOPENGL_PLATFORM", "egl")
    if platform != "egl":
        return f"PYOPENGL_PLATFORM={platform} does not work here; unset it to use egl"
    return f"install the system package(s) {' '.join(missing_packages())} (Debian, Ubuntu: apt-get install ...)"


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def install() -> bool:
    """Install the missing packages with apt, if we are root on a system that has it."""
    apt = shutil.which("apt-get")
    if apt is None or os.geteuid() != 0:
        return False
    packages = missing_packages()
    print(f"installing the system package(s) {' '.join(packages)}", flush=True)
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    subprocess.run([apt, "update", "-qq"], env=quiet, stdout=subprocess.DEVNULL, check=False)
    command = [apt, "install", "-y", "-qq", "--no-install-recommends", *packages]
    return subprocess.run(command, env=quiet, stdout=subprocess.DEVNULL, check=False).returncode == 0


_drivers: list[str] = []  # the one by which a frame was drawn; another process need not try it again


def require_gl() -> str:
    """The driver's name, or ``HippodromeError`` with the cure. Tried until it has worked once in this process."""
    with gl_tried_beside() as required:
        return required()


@contextmanager
def gl_tried_beside() -> Iterator[Callable[[], str]]:
    """``require_gl`` for the block, with the trial begun already: it goes on beside what the block does before it asks.

    Where the block fails, or never asks, the trial ends with it, and nothing is said of OpenGL.
    """
    if _drivers:
        yield lambda: _drivers[0]
        return
    with _trial() as child:
        yield lambda: _drivers[0] if _drivers else _driver(_answer(child))


def _driver(found: tuple[bool, str]) -> str:
    works, line = found
    if not works:
        raise HippodromeError(line)
    _drivers.append(line)
    return line


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m hippodrome.sim.render.probe", description="Check off-screen OpenGL.")
    parser.add_argument("--install", action="store_true", help="install what is missing (root, apt)")
    parser.add_argument("--draw", action="store_true", help="draw in this process (used by the probe itself)")
    options = parser.parse_args(arguments)
    if options.draw:
        print(DRAWN + draw())
        return 0
    works, line = probe()
    if not works and options.install and install():
        works, line = probe()
    print(f"off-screen OpenGL works: {line}" if works else line, file=sys.stdout if works else sys.stderr)
    return 0 if works else 2


if __name__ == "__main__":
    sys.exit(main())
