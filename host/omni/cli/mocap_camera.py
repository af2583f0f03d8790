# SPDX-License-Identifier: MIT
"""``omni mocap markers``, ``calibrate``, ``place`` and ``look``: a webcam as motion capture, until its poses stream."""

from __future__ import annotations

import enum
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from omni.cli.common import JsonOption, console, examples, note, print_json, writable_path
from omni.cli.options import ForceOption
from omniwheel.limits import TAG_FAMILIES

if TYPE_CHECKING:
    from omniwheel.mocap.camera.library import Array
    from omniwheel.mocap.camera.setup import CameraSetup
    from omniwheel.mocap.camera.watch import Look, Watcher

ENOUGH = 25
"""Pictures of the board that a live calibration takes."""
PLACE_PICTURES = 10
_WAIT_S = 0.5
_SILENT_S = 10.0


class Paper(str, enum.Enum):
    """Paper sizes."""

    A4 = "a4"
    LETTER = "letter"


class Kind(str, enum.Enum):
    """What the sheets are written as."""

    PDF = "pdf"
    SVG = "svg"
    PNG = "png"


CameraArgument = Annotated[Path, typer.Argument(metavar="CAMERA.toml", help="The camera file.")]
PicturesArgument = Annotated[
    list[Path] | None,
    typer.Argument(metavar="PICTURE", help="Pictures, or folders of them. Default: the camera itself."),
]
EXAMPLES = {
    "markers": examples("omni mocap markers tags", "omni mocap markers tags --paper letter --floor 6 --force"),
    "calibrate": examples("omni mocap calibrate tags/camera.toml", "omni mocap calibrate tags/camera.toml board"),
    "place": examples("omni mocap place tags/camera.toml", "omni mocap place tags/camera.toml empty_floor.png"),
    "look": examples("omni mocap look tags/camera.toml", "omni mocap look tags/camera.toml floor1.png --json"),
}


def markers(
    out: Annotated[Path, typer.Argument(metavar="DIR", help="Folder for the sheets and the first camera file.")],
    family: Annotated[str, typer.Option("--family", help=f"Tag family: {', '.join(TAG_FAMILIES)}.")] = next(
        iter(TAG_FAMILIES)
    ),
    floor: Annotated[int, typer.Option("--floor", min=1, max=20, metavar="N", help="Number of floor tags.")] = 4,
    floor_size: Annotated[
        float,
        typer.Option(
            "--floor-size", min=0.02, max=0.16, metavar="M", help="Side length of a floor tag's black square."
        ),
    ] = 0.15,
    robot_size: Annotated[
        float,
        typer.Option(
            "--robot-size", min=0.02, max=0.16, metavar="M", help="Side length of the robot tag's black square."
        ),
    ] = 0.12,
    paper: Annotated[Paper, typer.Option("--paper", help="Paper size.")] = Paper.A4,
    kind: Annotated[Kind, typer.Option("--sheets", help="File format of the sheets.")] = Kind.PDF,
    force: ForceOption = False,
) -> None:
    """Write sheets to print in true size: tags for floor and robot, the calibration board, and a camera file."""
    from omniwheel import files
    from omniwheel.mocap.camera.sheets import sheets, template, write_sheet

    if family not in TAG_FAMILIES:
        raise typer.BadParameter(f"unknown tag family {family!r}; must be one of {', '.join(TAG_FAMILIES)}")
    camera = out / "camera.toml"
    if camera.exists() and not force:
        raise typer.BadParameter(f"{camera} exists already; choose another folder or give --force")
    if out.exists() and not out.is_dir():
        raise typer.BadParameter(f"{out} is not a folder")
    out.mkdir(parents=True, exist_ok=True)
    writable_path(camera, "write")
    numbers = list(range(1, floor + 1))
    robot = min(TAG_FAMILIES[family] - 1, floor + 9)
    for name, sheet in sheets(family, numbers, floor_size, robot, robot_size, paper.value):
        write_sheet(sheet, out / f"{name}.{kind.value}")
    files.write_text(camera, template(family, numbers, floor_size, robot, robot_size))
    note(f"{floor + 2} sheets and {camera}: print at 100 %, and measure the line of 100 mm at the foot")


def calibrate(camera: CameraArgument, pictures: PicturesArgument = None, as_json: JsonOption = False) -> None:
    """Find the camera's lens from pictures of the calibration board, and write the lens file.

    Without pictures the camera takes them: hold the board still, then elsewhere, until there are enough.
    """
    from omniwheel.mocap.camera.calibrate import Collector, find_lens
    from omniwheel.mocap.camera.lens import save_lens
    from omniwheel.mocap.camera.setup import load_setup

    setup = load_setup(camera)
    collector = Collector()
    try:
        for name, picture in _pictures(setup, pictures):
            reason = collector.add(name, picture)
            count = len(collector.collected.views)
            if pictures or not reason:
                note(f"{escape(name)}: {reason or f'used, {count} so far'}", quiet=as_json)
            if not pictures and count >= ENOUGH:
                break
    except KeyboardInterrupt:
        note("", quiet=as_json)
    lens = find_lens(collector.collected)
    if (lens.width, lens.height) != (setup.width, setup.height):
        what = f"the pictures have {lens.width} x {lens.height} pixels, the camera file {setup.width} x {setup.height}"
        raise typer.BadParameter(f"{what}; take pictures at the resolution of the camera's stream")
    save_lens(lens, setup.lens_path)
    if as_json:
        print_json({"file": str(setup.lens_path), "rms_px": lens.rms_px, "pictures": lens.pictures})
    else:
        console.print(
            f"{setup.lens_path}: {lens.pictures} pictures, {lens.rms_px:.2f} px RMS reprojection error (below 0.5 is "
            "good), "
            f"focal length {lens.focal_px[0]:.0f} px"
        )


def place(camera: CameraArgument, pictures: PicturesArgument = None, as_json: JsonOption = False) -> None:
    """Find where the camera is from the tags on the floor, and write the place file.

    This defines the world: x, y and headings are those of the floor's tags in the camera file.
    """
    from omniwheel.mocap.camera.place import find_place, save_place

    watcher = _watcher(camera, placed=False)
    corners = _mean_corners(watcher, pictures)
    found = find_place(watcher.lens, watcher.setup.floor, corners)
    save_place(found, watcher.setup)
    x, y, z = (float(value) for value in found.eye.position)
    if as_json:
        offsets = {str(number): off for number, off in found.offsets_m.items()}
        where = {"position_m": [x, y, z], "rms_px": found.rms_px, "offsets_m": offsets, "sd_m": found.sd_m}
        print_json({"file": str(watcher.setup.place_path), **where})
        return
    console.print(
        f"{escape(str(watcher.setup.place_path))}: the camera is at x {x:.3f}, y {y:.3f}, {z:.3f} m above the floor"
    )
    for number, off in sorted(found.offsets_m.items()):
        console.print(f"  floor tag {number}: {1e3 * off:.1f} mm from its place in the camera file")
    console.print(f"  1 m from them, poses are accurate to {1e3 * found.sd_m:.1f} mm (standard deviation)")


def look(
    camera: CameraArgument,
    pictures: PicturesArgument = None,
    count: Annotated[
        int,
        typer.Option("--count", min=1, metavar="N", help="Number of pictures after which to end.", show_default=False),
    ] = 10**9,
    as_json: JsonOption = False,
) -> None:
    """Say what is in each picture: the tags, the robot's pose and how sure it is, or why there is none."""
    watcher = _watcher(camera, placed=True)
    rows = []
    try:
        for at, (name, picture) in enumerate(_pictures(watcher.setup, pictures), start=1):
            seen = watcher.look(picture)
            if as_json:
                rows.append({"picture": name, **_as_dict(seen)})
            else:
                console.print(f"{escape(name)}: {_line(watcher, picture, seen)}", soft_wrap=True)
            if at >= count:
                break
    except KeyboardInterrupt:
        note("", quiet=as_json)
    if as_json:
        print_json({"pictures": rows})


def _watcher(camera: Path, *, placed: bool) -> Watcher:
    from omniwheel.mocap.camera.lens import load_lens
    from omniwheel.mocap.camera.place import load_place
    from omniwheel.mocap.camera.setup import load_setup
    from omniwheel.mocap.camera.watch import Watcher

    setup = load_setup(camera)
    lens = load_lens(setup.lens_path)
    eye = load_place(setup, lens) if placed and setup.place_path.exists() else None
    return Watcher(setup, lens, eye)


def _pictures(setup: CameraSetup, paths: list[Path] | None) -> Iterator[tuple[str, Array]]:
    from omniwheel.mocap.camera.frames import open_frames, pictures_in, read_picture

    for path in paths or ():
        for each in pictures_in(path) if path.is_dir() else [path]:
            yield each.name, read_picture(each)
    if paths:
        return
    frames = open_frames(setup)
    silent_s = 0.0
    try:
        while not frames.ended and silent_s < _SILENT_S:
            frame = frames.read(_WAIT_S)
            silent_s = 0.0 if frame is not None else silent_s + _WAIT_S
            if frame is not None:
                yield f"picture {frame.number}", frame.picture
    finally:
        frames.close()


def _mean_corners(watcher: Watcher, paths: list[Path] | None) -> dict[int, Any]:
    """Return the mean corners of the floor's tags over some pictures; say so if the picture is a mirror image."""
    import numpy as np

    from omniwheel.errors import CameraError

    floor = {tag.id for tag in watcher.setup.floor}
    found: dict[int, list[Array]] = {}
    for at, (_, picture) in enumerate(_pictures(watcher.setup, paths), start=1):
        if watcher.mirrored(picture):
            hint = "switch that off in the camera's settings"
            raise CameraError("the tags are seen as in a mirror: the camera turns its pictures over", hint=hint)
        for number, corners in watcher.look(picture).tags.items():
            if number in floor:
                found.setdefault(number, []).append(corners)
        if not paths and at >= PLACE_PICTURES:
            break
    _need_still(found)
    return {number: np.mean(corners, axis=0) for number, corners in found.items()}


def _need_still(found: dict[int, list[Array]]) -> None:
    import numpy as np

    from omniwheel.errors import CameraError
    from omniwheel.mocap.camera.watch import MOVED_PX

    for number, corners in found.items():
        if max(np.abs(each - corners[0]).max() for each in corners) > MOVED_PX:
            hint = "mount the camera rigidly; give pictures of one camera position only"
            raise CameraError(f"floor tag {number} moves from picture to picture", hint=hint)


def _as_dict(seen: Look) -> dict[str, Any]:
    data: dict[str, Any] = {"tags": sorted(seen.tags), "others": list(seen.others), "reason": seen.reason}
    if seen.found is not None:
        data["pose"] = list(seen.found.pose)
        data["misfit_px"] = seen.found.rms_px
        data["noise_sd"] = [float(value) ** 0.5 for value in seen.found.noise.diagonal()]
        data["bias_sd"] = [float(value) ** 0.5 for value in seen.found.bias.diagonal()]
    return data


def _line(watcher: Watcher, picture: Array, seen: Look) -> str:
    tags = ", ".join(str(number) for number in sorted(seen.tags)) or "none"
    others = f"; not in the camera file: {', '.join(map(str, seen.others))}" if seen.others else ""
    if seen.found is None:
        mirror = "; the picture is a mirror image: switch that off" if watcher.mirrored(picture) else ""
        return f"no pose: {seen.reason}{mirror} (tags {tags}{others})"
    x, y, theta = seen.found.pose
    noise, bias = (
        [float(value) ** 0.5 for value in matrix.diagonal()] for matrix in (seen.found.noise, seen.found.bias)
    )
    return (
        f"x {x:.3f} m, y {y:.3f} m, heading {theta:+.3f} rad; noise {1e3 * max(noise[:2]):.1f} mm, "
        f"{1e3 * noise[2]:.1f} mrad; place {1e3 * max(bias[:2]):.1f} mm; misfit {seen.found.rms_px:.2f} px "
        f"(tags {tags}{others})"
    )
