"""OAK: the calibration JSON of Luxonis's DepthAI, with a camera for each socket of the board."""

from __future__ import annotations

from camviz.cameras import Camera
from camviz.lenses import BrownConrady, KannalaBrandt, Lens
from camviz.poses import RigidTransform
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.section import Section, Size, agreed_size, explained
from camviz_clinic.files.trees import shown

TITLE = "OAK (DepthAI) calibration"
MOST = 64  # cameras; boards have at most a dozen sockets


def read(file: File) -> Calibration:
    """The cameras by their extrinsics, each to the socket that it names; the world is the first socket's frame."""
    parts = _parts(file.section)
    cameras, notes = {}, []
    for socket, part in parts.items():
        if any(part.matrix("intrinsicMatrix", 3, 3).ravel()[:5]):
            cameras[socket] = _camera(part, file.size)
        else:
            notes.append(f"{_name(socket)} was never calibrated and is left out.")
    if not cameras:
        raise CalibrationError("expected at least one camera with an intrinsicMatrix, found none")
    poses = _placed({socket: parts[socket] for socket in cameras}, next(iter(cameras)))
    lost = [_name(socket) for socket in cameras if socket not in poses]
    if lost:
        notes.append(f"The file does not say where {', '.join(lost)} stands: it is drawn at the origin.")
    held = {
        _name(socket): camera.at(poses[socket]) if socket in poses else camera for socket, camera in cameras.items()
    }
    return Calibration(held, file.path, TITLE, notes=tuple(notes))


def _name(socket: int) -> str:
    return f"CAM_{chr(ord('A') + socket)}"


def _parts(section: Section) -> dict[int, Section]:
    """Pairs of a socket and its camera."""
    held = section.get("cameraData", "pairs of a socket and a camera")
    if not isinstance(held, list) or not 1 <= len(held) <= MOST:
        raise section.error("cameraData", f"pairs of a socket and a camera, from 1 to {MOST}", shown(held))
    parts = {}
    for index, pair in enumerate(held):
        where = section.where(f"cameraData[{index}]")
        if not (isinstance(pair, list) and len(pair) == 2 and isinstance(pair[1], dict) and pair[0] in range(26)):
            raise CalibrationError(f"{where}: expected a socket from 0 to 25 and a mapping, got {shown(pair)}")
        if pair[0] in parts:
            raise CalibrationError(f"{where}: the socket {pair[0]} appears twice")
        parts[int(pair[0])] = section.part(pair[1], where)
    return dict(sorted(parts.items()))


def _camera(part: Section, given: Size | None) -> Camera:
    size = agreed_size(part.sides("width", "height"), given, "width, height")
    grid = part.intrinsics(part.matrix("intrinsicMatrix", 3, 3), part.where("intrinsicMatrix"), size)
    return Camera(grid, _lens(part))


def _lens(part: Section) -> Lens:
    kind = part.number("cameraType") if "cameraType" in part else 0
    if kind not in (0, 1):
        raise part.error("cameraType", "0 (perspective) or 1 (fisheye)", f"{kind:g}")
    values = part.vector("distortionCoeff", [4, 5, 8, 12, 14], "k1 k2 p1 p2 k3 …")
    with explained(part.where("distortionCoeff")):
        return KannalaBrandt(*values[:4]) if kind else BrownConrady.from_coefficients(values)


def _placed(parts: dict[int, Section], first: int) -> dict[int, RigidTransform]:
    """first_from_cam of each camera that a chain of extrinsics joins to the first one."""
    joined: dict[int, dict[int, RigidTransform]] = {socket: {} for socket in parts}
    for socket, part in parts.items():
        extrinsics = part.section("extrinsics") if "extrinsics" in part else part.part({}, part.path)
        to = extrinsics.number("toCameraSocket") if "toCameraSocket" in extrinsics else -1
        if to in parts and to != socket:
            pose = _pose(extrinsics)
            joined[int(to)][socket], joined[socket][int(to)] = pose, pose.inv()
    poses, ahead = {first: RigidTransform.identity()}, [first]
    while ahead:
        at = ahead.pop()
        for socket, pose in joined[at].items():
            if socket not in poses:
                poses[socket] = poses[at] * pose
                ahead.append(socket)
    return poses


def _pose(extrinsics: Section) -> RigidTransform:
    """From this camera to the other, in metres; DepthAI has centimetres."""
    place = extrinsics.section("translation")
    metres = [place.number(axis) / 100 for axis in "xyz"]
    return RigidTransform.from_components(metres, extrinsics.rotation("rotationMatrix"))


FORMAT = Format(
    name="oak",
    title=TITLE,
    file="calib.json",
    recognise=lambda file: "cameraData" in file.section,
    read=read,
    models="perspective with 14 coefficients of OpenCV, fisheye with 4",
    says="extrinsics: from this camera to toCameraSocket, in centimetres; CAM_A is socket 0",
    example=b"""{"batchName": "", "boardName": "made", "version": 7, "cameraData": [
[2, {"cameraType": 0, "width": 640, "height": 400, "lensPosition": 0, "specHfovDeg": 71.86,
  "intrinsicMatrix": [[399.5, 0.0, 331.25], [0.0, 399.75, 191.0], [0.0, 0.0, 1.0]],
  "distortionCoeff": [-4.5, 9.25, 0.001, -0.0005, 3.5, -4.625, 9.75, 2.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
  "extrinsics": {"toCameraSocket": -1, "rotationMatrix": [], "translation": {"x": 0, "y": 0, "z": 0}}}],
[1, {"cameraType": 1, "width": 640, "height": 400, "lensPosition": 0, "specHfovDeg": 71.86,
  "intrinsicMatrix": [[398.5, 0.0, 330.25], [0.0, 398.75, 192.0], [0.0, 0.0, 1.0]],
  "distortionCoeff": [0.01, -0.002, 0.003, -0.0004, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0],
  "extrinsics": {"toCameraSocket": 2, "rotationMatrix": [[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]],
  "translation": {"x": -7.5, "y": 0.25, "z": 0.125}}}]]}
""",
    rank=48,
)
