"""`camviz undistort`: a folder of photographs as the pinhole camera would have taken them that they lead to."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.commands.common import (
    OK,
    Refusal,
    add_command,
    add_megapixels,
    bounded,
    chosen_camera,
    loaded,
    refuse_folder,
    size,
    whole_folder,
)
from camviz_clinic.commands.pictures import Bar, encoded, pictures
from camviz_clinic.commands.terminal import tell

if TYPE_CHECKING:
    from camviz.cameras import Camera
    from camviz_clinic.datasets.undistortion import Undistortion

UNDISTORT = """\
Takes the distortion out of all photographs of a camera, and writes them with the pinhole camera that they are of now:

  OUT/images/      the pictures, under their own names (blanks become _), all with one K
  OUT/camera.yaml  that K, and no distortion: whoever reads it need not undistort again
  OUT/mask.png     white where a picture shows the photograph, black where it shows nothing

--alpha 0 shows no border, --alpha 1 every pixel of the photographs; of a fisheye at most 80 degrees to each side. A
fisheye keeps its principal point. Photographs are taken as their pixels lie in the file, whichever way the phone was
held. Those of another size, and those that cannot be read, are named and left out.
"""
EPILOG = """\
examples:
  camviz undistort camera.yaml photos/ -o flat/
  camviz undistort camera.yaml photos/*.jpg -o flat/ --alpha 1
  camviz undistort rig.yaml left/ -o flat/ --camera left

exit status:
  0  OUT is written
  2  nothing is: a file cannot be read, or the command cannot be used; one sentence on stderr says why
  3  something is missing on this machine
"""
IMAGES, MASK, CAMERA = "images", "mask.png", "camera.yaml"


def add(commands: Any) -> None:
    command = add_command(commands, "undistort", undistort, "take the distortion out of photographs", UNDISTORT)
    command.epilog = EPILOG
    command.add_argument("calibration", metavar="CAMERA", type=Path, help="the camera's calibration (- is stdin)")
    command.add_argument("images", metavar="IMAGES", nargs="+", help="photographs, folders of them, or patterns")
    command.add_argument("-o", "--output", metavar="OUT", type=Path, required=True, help="a new folder")
    add_alpha(command)
    command.add_argument("--camera", metavar="NAME", help="the camera that took IMAGES, where CAMERA has several")
    command.add_argument("--size", metavar="WxH", type=size, help="image size, where CAMERA does not hold it")
    add_megapixels(command)


def add_alpha(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--alpha",
        metavar="A",
        type=bounded("a share", 0, 1),
        default=0.0,
        help="0 without borders, to 1 with every pixel of the photographs (default: 0)",
    )


def undistort(options: argparse.Namespace) -> int:
    """Write the undistorted pictures, their camera and their mask, whole or not at all."""
    refuse_folder(options.output)
    camera = chosen_camera(loaded(options.calibration, options.size), options)
    paths = pictures(options.images)
    flat, names = undistortion_of(camera, options.alpha), output_names(paths)
    with whole_folder(options.output) as folder:
        skipped = write_undistorted(flat, dict(zip(paths, names, strict=True)), folder)
    for said in [*(f"{path.name}: skipped, {why}." for path, why in skipped), told(flat)]:
        tell(said)
    tell(f"{options.output}: {len(paths) - len(skipped)} pictures written, with {CAMERA} and {MASK}.")
    return OK


def undistortion_of(camera: Camera, alpha: float) -> Undistortion:
    """How the photographs of a camera become flat; Refusal where no pinhole shows what it sees."""
    from camviz_clinic.datasets.undistortion import Undistortion

    try:
        return Undistortion.of(camera, alpha)
    except ValueError as error:
        raise Refusal(f"{error}.") from error


def output_names(paths: Sequence[Path]) -> list[str]:
    """A name for each picture, without blanks, which COLMAP does not take; Refusal where two would be one."""
    named: dict[str, Path] = {}
    for path in paths:
        name = "_".join(path.name.replace("#", "_").split())
        if name in named:
            raise Refusal(f"{named[name]} and {path} would both be written as {name}: rename one of them.")
        named[name] = path
    return list(named)


def write_undistorted(flat: Undistortion, names: dict[Path, str], folder: Path) -> list[tuple[Path, str]]:
    """Write pictures under these names, with their camera and mask; those that were left out, each with the reason.

    Raises Refusal where none could be written.
    """
    from camviz.colour.picture_files import PictureError, read_picture
    from camviz_clinic.calibration.types import Calibration
    from camviz_clinic.files.writing import write

    skipped: list[tuple[Path, str]] = []
    (folder / IMAGES).mkdir()
    with Bar() as bar:
        for number, (path, name) in enumerate(names.items(), 1):
            try:
                photograph = read_picture(path)
                refuse_other_size(photograph.shape[1], photograph.shape[0], flat.camera)
                (folder / IMAGES / name).write_bytes(encoded(flat.picture(photograph), Path(name)))
            except PictureError as error:
                skipped.append((path, error.why))
            except Refusal as refusal:
                skipped.append((path, str(refusal).rstrip(".")))
            bar(number, len(names))
    if len(skipped) == len(names):
        path, why = skipped[0]
        raise Refusal(f"none of the pictures can be used: {why} ({path}).")
    (folder / MASK).write_bytes(encoded(flat.mask, Path(MASK)))
    write(Calibration({"camera": flat.pinhole}, folder, "camviz"), folder / CAMERA, "opencv")
    return skipped


def refuse_other_size(width: int, height: int, camera: Camera) -> None:
    """Refuses pictures of another size than the camera's."""
    grid = camera.intrinsics
    if (width, height) == (grid.width, grid.height):
        return
    turned = ", as if it were turned" * ((height, width) == (grid.width, grid.height))
    raise Refusal(f"it has {width}×{height} pixels, the camera {grid.width}×{grid.height}{turned}.")


def told(flat: Undistortion) -> str:
    """The pinhole of the pictures, and how much of them shows nothing, in a sentence."""
    grid = flat.target
    border = f"{flat.masked:.1%} of a picture shows nothing" if flat.masked else "every pixel shows the photograph"
    return (
        f"pinhole: {grid.width}×{grid.height} pixels, fx = {grid.fx:.2f}, fy = {grid.fy:.2f}, cx = {grid.cx:.2f}, "
        f"cy = {grid.cy:.2f} px, no distortion; {border}."
    )
