"""Which cameras saw the board in the same frames: the links between them, and the islands where these are missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush

import numpy as np
from numpy.typing import NDArray

from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.arrowhead import inverse
from camviz_clinic.calibration.enumeration import enumerated
from camviz_clinic.calibration.types import Mask

Indices = NDArray[np.intp]
MOST = 150


@dataclass(frozen=True, eq=False)
class Link:
    """Two cameras that see the board together.

    Args:
        one, other: The cameras.
        frames: (n,), the frames that both have.
        by_frame: one_from_other by each of these frames alone, from the pose that either camera has of the board.
        one_from_other: That of `by_frame` with which the others agree best.
        deviation: In metres, how well the frames together place the one board before the other camera.
    """

    one: str
    other: str
    frames: Indices
    by_frame: RigidTransform
    one_from_other: RigidTransform
    deviation: float


def islands(seen: Mapping[str, Mask]) -> list[tuple[str, ...]]:
    """The groups of cameras that are tied together by frames in which two of them see the board.

    Args:
        seen: (frames,) of bool by camera, True where the camera sees enough of the board for its pose.

    Returns: Names in their order, the group of the first camera first; one group where all is connected.

    >>> a, b, c = np.array([[1, 1, 0], [0, 1, 0], [0, 0, 1]], dtype=bool)
    >>> islands({"a": a, "b": b, "c": c})
    [('a', 'b'), ('c',)]
    """
    groups: list[set[str]] = []
    for name, frames in seen.items():
        touched = [group for group in groups if any((frames & seen[other]).any() for other in group)]
        groups = [group for group in groups if group not in touched] + [set.union({name}, *touched)]
    ordered = [tuple(name for name in seen if name in group) for group in groups]
    return sorted(ordered, key=lambda group: list(seen).index(group[0]))


def parted(groups: Sequence[tuple[str, ...]], order: Sequence[str]) -> str:
    """What is missing between islands, in one sentence without its full stop.

    Args:
        groups: Of `islands`, at least two.
        order: The cameras in the order in which they were given.

    Returns: Who never sees the board together, and to which two cameras to show it: those next to each other in that
        order.

    >>> parted([("cam0", "cam1"), ("cam2",)], ["cam0", "cam1", "cam2"])
    'cam0 and cam1 never see the board in one frame with cam2: show it to cam1 and cam2 together'
    """
    names = [enumerated(group) for group in groups]
    place = {name: number for number, name in enumerate(order)}
    bridges = []
    for group in groups[1:]:
        pairs = [(abs(place[a] - place[b]), a, b) for a in groups[0] for b in group]
        _, one, other = min(pairs)
        bridges.append(f"{one} and {other}")
    return f"{names[0]} never see{'s' * (len(groups[0]) == 1)} the board in one frame with " + (
        f"{'; nor with '.join(names[1:])}: show it to {', and to '.join(bridges)} together"
    )


def links(alone: Mapping[str, Adjustment]) -> dict[tuple[str, str], Link]:
    """Every two cameras that share frames, and how they stand to each other by these.

    Args:
        alone: By camera, its own problem with the board's poses as it sees them; all have the same frames.

    Returns: By their names, the earlier camera first.
    """
    names, found = list(alone), {}
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            frames = np.flatnonzero(alone[one].posed & alone[other].posed)
            if len(frames):
                found[one, other] = _link(alone[one], alone[other], one, other, frames)
    return found


def chained(names: Sequence[str], found: Mapping[tuple[str, str], Link]) -> dict[str, RigidTransform]:
    """Where the cameras stand in the first one's frame, each by the chain of links that places it best.

    The variances of the links add up along a chain (Dijkstra 1959).

    Args:
        names: The cameras.
        found: Of `links`; they must connect all of them.

    Returns: first_from_cam by name.
    """
    queue: list[tuple[float, int, str, RigidTransform]] = [(0.0, 0, names[0], RigidTransform.identity())]
    placed: dict[str, RigidTransform] = {}
    count = 0
    while queue:
        variance, _, here, pose = heappop(queue)
        if here in placed:
            continue
        placed[here] = pose
        for (one, other), link in found.items():
            if here in (one, other):
                there, step = (other, link.one_from_other) if here == one else (one, link.one_from_other.inv())
                count += 1
                heappush(queue, (variance + link.deviation**2, count, there, pose * step))
    return {name: placed[name] for name in names}


def adjoint(pose: RigidTransform) -> Array:
    """(…, 6, 6), which takes twists (ω, τ) of the frame that a pose leads from to the one it leads to."""
    rotation, t = pose.rotation.as_matrix(), np.atleast_2d(pose.translation)
    rotation = rotation.reshape(-1, 3, 3)
    matrix = np.zeros((len(rotation), 6, 6))
    matrix[:, :3, :3] = matrix[:, 3:, 3:] = rotation
    matrix[:, 3:, :3] = cross(t) @ rotation
    return matrix[0] if pose.single else matrix


def cross(vectors: Array) -> Array:
    """[t]ₓ of vectors (…, 3), (…, 3, 3)."""
    return np.asarray(np.swapaxes(np.cross(vectors[..., None, :], np.eye(3)), -1, -2), dtype=float)


def _link(first: Adjustment, second: Adjustment, one: str, other: str, frames: Indices) -> Link:
    poses = [each.first_from_board[frames] for each in (first, second)]
    by_frame = poses[0] * poses[1].inv()
    middle = by_frame[middlemost(by_frame, poses[1].translation)]
    twist = adjoint(middle)
    spread = [each.pose_covariance[frames] for each in (first, second)]
    information = inverse(spread[0] + twist @ spread[1] @ twist.T).sum(axis=0)
    # A board's middle, seen by the other camera: how far it is off in the one's frame by the error of this pose.
    at = middle.apply(poses[1].translation.mean(axis=0))
    shift = np.hstack([-cross(at), np.eye(3)])
    variance = float(np.trace(shift @ inverse(information) @ shift.T))
    return Link(one, other, frames, by_frame, middle, float(np.sqrt(variance)))


def middlemost(poses: RigidTransform, points: Array) -> int:
    """The pose that puts points (n, 3) before the camera at the smallest sum of distances from where the others do."""
    if len(poses) > MOST:  # every few of them, for each is compared with each
        some = np.linspace(0, len(poses) - 1, MOST).astype(int)
        return int(some[middlemost(poses[some], points)])
    every = max(1, len(points) // 20)
    placed = np.einsum("nij,pj->npi", poses.rotation.as_matrix(), points[::every]) + poses.translation[:, None]
    turned = poses.rotation.as_matrix().reshape(len(poses), -1)
    size = float(np.median(np.linalg.norm(points, axis=1)))
    apart = np.linalg.norm(placed[:, None] - placed[None], axis=-1).mean(axis=-1)
    apart += size * np.linalg.norm(turned[:, None] - turned[None], axis=-1)
    return int(np.argmin(apart.sum(axis=1)))
