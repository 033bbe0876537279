"""Tables of robot poses: every form gives the same poses, what is assumed is said, and the rest is refused."""

import numpy as np
import pytest

from camviz.poses import RigidTransform, Rotation
from camviz_clinic.handeye import PoseError, read_poses

TURNS = Rotation.from_rotvec([[0.1, -0.4, 0.3], [0.5, 0.2, -1.1], [-0.3, 0.9, 2.0]])
PLACES = np.array([[0.4, -0.1, 0.3], [0.45, 0.2, 0.25], [0.38, 0.05, 0.6]])
POSES = RigidTransform.from_components(PLACES, TURNS)


@pytest.fixture
def table(room):
    """Writes a table and reads it: a header, then numbers in columns."""

    def read(header, *columns, divider=",", **options):
        rows = np.column_stack(columns)
        lines = ([header] if header else []) + [divider.join(f"{value:.12g}" for value in row) for row in rows]
        (room / "poses.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
        return read_poses(room / "poses.csv", **options)

    return read


def test_every_form_of_rotation_gives_the_same_poses(table):
    matrices = POSES.as_matrix()
    q, degrees = TURNS.as_quat(), {"degrees": True}
    forms = [
        table("x,y,z,qx,qy,qz,qw", PLACES, q),
        table("tx,ty,tz,qw,qx,qy,qz", PLACES, q[:, [3, 0, 1, 2]]),
        table("x [mm]\ty [mm]\tz [mm]\tq1\tq2\tq3\tq4", 1000 * PLACES, q[:, [3, 0, 1, 2]], divider="\t"),
        table("", PLACES, q[:, [3, 0, 1, 2]], divider=" ", rotation="wxyz"),
        table("", [7, 8, 9], PLACES, q, divider=" "),
        table("x;y;z;rx;ry;rz", PLACES, TURNS.as_rotvec(), divider=";"),
        table("X_mm,Y_mm,Z_mm,A,B,C", 1000 * PLACES, TURNS.as_euler("ZYX", **degrees)),
        table("x,y,z,w,p,r", 1000 * PLACES, TURNS.as_euler("xyz", **degrees)),
        table("x,y,z,roll,pitch,yaw", PLACES, TURNS.as_euler("xyz")),
        table("x,y,z,rx_deg,ry_deg,rz_deg", PLACES, TURNS.as_euler("XZY", **degrees), rotation="euler-XZY"),
        table("", PLACES, TURNS.as_euler("zyx", **degrees), rotation="euler-zyx", angles="deg"),
        table("", matrices.reshape(3, 16)),
        table("", matrices.swapaxes(1, 2).reshape(3, 16)),
        table("", matrices[:, :3].reshape(3, 12)),
        table("x,y,z,r11,r12,r13,r21,r22,r23,r31,r32,r33", PLACES, matrices[:, :3, :3].reshape(3, 9)),
    ]
    for read in forms:
        assert read.base_from_hand.as_matrix() == pytest.approx(matrices, abs=1e-9), read.assumed


def test_a_decimal_comma_is_read_where_semicolons_divide(room):
    (room / "poses.csv").write_text("x;y;z;qx;qy;qz;qw\n0,4;0;0,3;0;0;0;1\n", encoding="utf-8")
    assert read_poses("poses.csv").base_from_hand.translation.tolist() == [[0.4, 0, 0.3]]


def test_pictures_and_times_are_kept(room):
    (room / "poses.csv").write_text("# a remark\npicture,time,x,y,z,rx,ry,rz\na.png,1.5,0,0,1,0,0,0\n")
    read = read_poses("poses.csv")
    assert read.names == ("a.png",)
    assert read.times.tolist() == [1.5]


def test_twenty_metres_are_metres_and_more_are_millimetres(table):
    at = np.array([[20.0, 0, 0]]), np.array([[0, 0, 0, 1.0]])
    read = table("x,y,z,qx,qy,qz,qw", *at)
    assert read.base_from_hand.translation[0, 0] == 20
    assert read.assumed[0] == "Lengths were read as metres, because none is larger than 20."
    read = table("x,y,z,qx,qy,qz,qw", at[0] * 1.0001, at[1])
    assert read.base_from_hand.translation[0, 0] == pytest.approx(0.020002)
    assert read.assumed[0] == "Lengths were read as millimetres, because one is larger than 20."
    assert table("x,y,z,qx,qy,qz,qw", *at, unit="mm").base_from_hand.translation[0, 0] == 0.02
    assert table("x_m,y_m,z_m,qx,qy,qz,qw", at[0] * 2, at[1]).base_from_hand.translation[0, 0] == 40


def test_angles_above_a_full_turn_are_degrees_and_the_sentence_says_so(table):
    here = np.zeros((1, 3))
    said = "Rotations were read, by their columns' names rx, ry, rz, as rotation vectors in {} is larger than 2π."
    radians = table("x,y,z,rx,ry,rz", here, [[6.28, 0, 0]])
    assert radians.assumed[1] == said.format("radians, because none")
    degrees = table("x,y,z,rx,ry,rz", here, [[6.3, 0, 0]])
    assert degrees.assumed[1] == said.format("degrees, because one")
    assert degrees.base_from_hand.rotation.magnitude()[0] == pytest.approx(np.radians(6.3))


def test_the_same_numbers_are_held_ready_in_the_other_forms(table):
    read = table("x,y,z,qx,qy,qz,qw", PLACES, TURNS.as_quat()[:, [3, 0, 1, 2]])
    assert read.others["--rotation wxyz"].as_matrix() == pytest.approx(POSES.as_matrix(), abs=1e-9)
    read = table("x,y,z,roll,pitch,yaw", PLACES, TURNS.as_euler("ZYX"))
    assert read.others["--rotation euler-ZYX"].as_matrix() == pytest.approx(POSES.as_matrix(), abs=1e-9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "expected a table of poses, the file is empty"),
        ("x,y,z,qx,qy,qz,qw\n", "expected poses below the header, there are none"),
        ("x,y,z\n1,2,3\n", "the header names no rotation, such as qx, qy, qz, qw; it has x, y, z"),
        ("0,0,1,0,0,0\n", "6 numbers a row without a header do not tell the form of the rotation"),
        ("0 0 1 0 0 0 1\n0 0 1\n", "line 2 has 3 columns, the first has 7"),
        ("x,y,z,qx,qy,qz,qw\n0,0,1,0,0,0,nine\n", "pose 1: expected a number, got 'nine'"),
        ("x,y,z,qx,qy,qz,qw\n0,0,1,0,0,0,inf\n", "pose 1: expected a number, got 'inf'"),
        ("x,y,z,qx,qy,qz,qw\n0,0,1,0,0,0,1\n0,0,1,0,0,1,1\n", "pose 2: a quaternion has length 1, this one 1.41"),
        ("1,0,0,0,0,1,0,0,0,0,-1,0\n", "pose 1: its 3 × 3 numbers are a mirror image, not a rotation"),
        ("1,0,0,0,0,1,0,0,0,0,2,0\n", "pose 1: its 3 × 3 numbers are no rotation"),
        ("1,0,0,.5,0,1,0,0,0,0,1,0,0,0,1,1\n", "the last row is 0, 0, 0, 1, here neither it nor the last column is"),
    ],
)
def test_what_is_no_table_of_poses_is_refused_in_one_sentence(room, text, said):
    (room / "poses.csv").write_text(text, encoding="utf-8")
    with pytest.raises(PoseError, match=r"^poses\.csv: ") as refusal:
        read_poses("poses.csv")
    assert said in str(refusal.value)


def test_a_quaternion_may_be_off_by_rounding_and_no_more(table):
    here = np.zeros((1, 3))
    table("x,y,z,qx,qy,qz,qw", here, [[0, 0, 0, 1.0199]])
    with pytest.raises(PoseError, match=r"a quaternion has length 1, this one 1\.02"):
        table("x,y,z,qx,qy,qz,qw", here, [[0, 0, 0, 1.0201]])
