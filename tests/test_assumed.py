"""What a reader of a file assumed is a finding, with what the other reading would change."""

import json

import numpy as np
import pytest
import yaml

from camviz_clinic.checks import inspect_file
from camviz_clinic.commands.command import main
from camviz_clinic.report.inspection import report


def file(tmp_path, D, **more):
    """A calibration as programs write it with K and D alone, 1280 × 720."""
    K = [[500.0, 0.0, 639.5], [0.0, 500.0, 359.5], [0.0, 0.0, 1.0]]
    path = tmp_path / "camera.yaml"
    path.write_text(yaml.safe_dump({"image_width": 1280, "image_height": 720, "K": K, "D": D, **more}))
    return path


def test_four_coefficients_are_a_warning_with_the_pixels_between_the_readings(tmp_path, capsys):
    """The same numbers by both of OpenCV's models: cv2.fisheye's θ(1 + k1 θ² …) and tan θ (1 + k1 tan² θ …)."""
    cv2 = pytest.importorskip("cv2")
    D = [-0.02, 0.004, 0.0, 0.0]
    path = file(tmp_path, [D])
    inspection = inspect_file(path)
    (finding,) = [each for each in inspection.findings if each.id == "assumed-coefficients"]
    assert finding.severity == "warning"
    K = np.array([[500.0, 0, 639.5], [0, 500, 359.5], [0, 0, 1]])
    u, v = np.meshgrid(np.linspace(0, 1279, 60), np.linspace(0, 719, 40))
    uv = np.stack([u, v], axis=-1).reshape(-1, 1, 2)
    criteria = (cv2.TERM_CRITERIA_MAX_ITER | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
    ideal = cv2.fisheye.undistortPoints(uv, K, np.array(D), criteria=criteria)
    rays = cv2.convertPointsToHomogeneous(ideal).reshape(-1, 3)
    other = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, np.array(D))[0]
    assert finding.value == pytest.approx(np.linalg.norm(other - uv, axis=-1).max(), rel=1e-4)
    assert finding.value > 80
    assert finding.sentence in inspection.as_text()
    assert "assumed-coefficients" in report(inspection)
    assert main(["inspect", "--json", str(path)]) == 1
    assert json.loads(capsys.readouterr().out)["findings"][0]["id"] == "assumed-coefficients"


@pytest.mark.parametrize(("D", "more"), [([-0.1, 0.01, 0, 0, 0], {}), ([-0.1, 0.01, 0, 0], {"fisheye_model": 1})])
def test_what_the_file_says_is_not_assumed(tmp_path, D, more):
    inspection = inspect_file(file(tmp_path, [D], **more))
    assert "assumed-coefficients" not in {each.id for each in inspection.findings}


def test_what_else_a_reader_noted_is_a_note(tmp_path):
    path = file(tmp_path, [[-0.1, 0.01, 0, 0, 0]], R=np.eye(3).tolist(), T=[0.1, 0.0, 0.0])
    inspection = inspect_file(path)
    (finding,) = [each for each in inspection.findings if each.id == "assumed-reading"]
    assert finding.severity == "note"
    assert finding.sentence.startswith("R and T are not used")
    assert inspection.healthy
