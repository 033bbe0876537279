"""Posed pictures in words, as a table, and as a tree for programs."""

from __future__ import annotations

from typing import Any

import numpy as np

from camviz_clinic.datasets.poses import CameraPoses
from camviz_clinic.files.output import as_rows

HEADER = (
    "picture",
    *("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"),
    *("sigma_x_m", "sigma_y_m", "sigma_z_m", "sigma_turn_x_deg", "sigma_turn_y_deg", "sigma_turn_z_deg"),
    *("corners", "rms_px"),
)
WORLD = "the board: origin at its first point, x along the rows, y down the columns, z into the board; metres"


def sentences(posed: CameraPoses) -> list[str]:
    """Who was refused, how well the others are known, and what the ± is."""
    place, turn = 1000 * posed.place_sigma.max(axis=1), np.degrees(posed.turn_sigma.max(axis=1))
    typical, worst = np.argsort(place)[len(place) // 2], np.argmax(place)
    camera = "is counted" if posed.camera_counted else "is not in it"
    alike = f", neighbours correlating by {posed.correlation:.2f}" * (posed.correlation > 0)
    return [
        *(f"{name}: refused, {why}." for name, why in posed.refused),
        f"{len(posed.names)} pictures have a pose; their corners are {posed.sigma:.3f} px off along each axis{alike}.",
        f"± {place[typical]:.2f} mm and {turn[typical]:.3f}° is the median; the worst is {posed.names[worst]} with "
        f"± {place[worst]:.2f} mm and {turn[worst]:.3f}° along the axis known least.",
        f"± is one standard deviation, by the corners' noise; an interval of 95 % reaches {posed.times_sigma:.2f} of "
        f"them to either side. What the camera's own numbers are uncertain by {camera}.",
    ]


def as_table(posed: CameraPoses) -> bytes:
    """One picture a row: board_from_cam with its standard deviations (CSV)."""
    pose = posed.board_from_cam
    numbers = np.column_stack(
        [pose.translation, pose.rotation.as_quat(), posed.place_sigma, np.degrees(posed.turn_sigma)]
    )
    lines = [
        ",".join([_cell(name), *(repr(float(x)) for x in row), str(int(count)), f"{rms:.4f}"])
        for name, row, count, rms in zip(posed.names, numbers, posed.corners, posed.rms, strict=True)
    ]
    return ("\n".join([",".join(HEADER), *lines]) + "\n").encode()


def _cell(name: str) -> str:
    return '"' + name.replace('"', '""') + '"' if set(name) & set(',"\n') else name


def as_tree(posed: CameraPoses) -> dict[str, Any]:
    """The same with matrices and covariances, for programs."""
    return {
        "world": WORLD,
        "sigma_px": posed.sigma,
        "correlation_of_neighbours": posed.correlation,
        "sigmas_of_95_percent": posed.times_sigma,
        "camera_uncertainty_counted": posed.camera_counted,
        "covariance_of": "cam_from_board: rotation about x, y, z in radians, then translation in metres, as "
        "p + w x p + t in the camera's frame",
        "pictures": [
            {
                "picture": name,
                "board_from_cam": as_rows(pose.inv()),
                "cam_from_board": as_rows(pose),
                "sigma_m": place.tolist(),
                "sigma_deg": np.degrees(turn).tolist(),
                "covariance": covariance.tolist(),
                "corners": int(count),
                "rms_px": float(rms),
            }
            for name, pose, place, turn, covariance, count, rms in zip(
                posed.names,
                posed.cam_from_board,
                posed.place_sigma,
                posed.turn_sigma,
                posed.covariance,
                posed.corners,
                posed.rms,
                strict=True,
            )
        ],
        "refused": dict(posed.refused),
    }
