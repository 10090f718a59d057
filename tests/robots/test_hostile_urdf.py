"""URDF files that would be misread without a word: what they leave out is refused by name, and they cannot do harm."""

from __future__ import annotations

import numpy as np
import pytest

from kineme.errors import DataError
from kineme.robots import JointTrajectory, load, preflight
from kineme.robots.models.urdf import read_chain

pytest.importorskip("pinocchio", reason="the extra robot is not installed")

JOINT = (
    '<joint name="{name}" type="revolute"><parent link="a"/><child link="b"/><axis xyz="{axis}"/>'
    '<limit lower="-1" upper="1" velocity="{velocity}" effort="1"/></joint>'
)
INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
BALL = '<collision>{}<geometry><sphere radius="0.1"/></geometry></collision>'


def urdf(folder, inside="", before="", name="j", axis="0 0 1", velocity="1"):
    """An arm of one joint, with something inside its last link or before everything else."""
    path = folder / "arm.urdf"
    joint = JOINT.format(name=name, axis=axis, velocity=velocity)
    path.write_text(f'{before}<robot name="r"><link name="a"/><link name="b">{inside}</link>{joint}</robot>')
    return path


def links(*names):
    return "".join(f'<link name="{name}"/>' for name in names)


def joint(k, parent, child):
    text = JOINT.format(name=f"j{k}", axis="0 0 1", velocity="1")
    return text.replace('"a"', f'"{parent}"').replace('"b"', f'"{child}"')


@pytest.mark.parametrize("tip", [None, "a", "b"])
@pytest.mark.parametrize(
    ("joints", "words"),
    [
        (joint(1, "c", "b") + joint(2, "b", "c"), "link 'b' is below itself, or below such a link; a URDF is a tree"),
        (joint(1, "ghost", "b"), "joint 'j1': expected links of this file, got 'ghost'"),
        (joint(1, "a", "ghost"), "joint 'j1': expected links of this file, got 'ghost'"),
    ],
)
def test_what_is_no_tree_is_refused(tmp_path, joints, words, tip):
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="r">{links("base", "a", "b", "c")}{joint(0, "base", "a")}{joints}</robot>')
    with pytest.raises(DataError, match=words):
        load(path, tip)


def test_a_chain_longer_than_any_stack_is_an_arm(tmp_path):
    n, path = 1200, tmp_path / "arm.urdf"
    joints = "".join(joint(k, f"l{k}", f"l{k + 1}") for k in range(n))
    path.write_text(f'<robot name="r">{links(*(f"l{k}" for k in range(n + 1)))}{joints}</robot>')
    assert len(read_chain(path, None).joints) == n


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"inside": f'<inertial><mass value="nan"/>{INERTIA}</inertial>'}, "link 'b': expected <inertial> with <mass"),
        ({"inside": f'<inertial><mass value="-5"/>{INERTIA}</inertial>'}, "link 'b': expected <inertial> with <mass"),
        ({"inside": '<inertial><mass value="1"/></inertial>'}, "link 'b': expected <inertial> with <mass"),
        ({"inside": "<inertial/>"}, "link 'b': expected <inertial> with <mass"),
        ({"inside": "<collision/>"}, "link 'b': expected the <geometry> of a <collision>"),
        ({"inside": "<collision><geometry/></collision>"}, "link 'b': expected the <geometry> of a <collision>"),
        ({"inside": '<collision><geometry><sphere radius="-1"/></geometry></collision>'}, "sizes above 0"),
        ({"inside": '<collision><geometry><box size="nan 1 1"/></geometry></collision>'}, "sizes above 0"),
        ({"inside": '<collision><geometry><torus radius="1"/></geometry></collision>'}, "to be a mesh, or a"),
        ({"inside": BALL.format('<origin xyz="0,0,1"/>')}, "expected <origin xyz=/> as 3 numbers .* got '0,0,1'"),
        ({"inside": BALL.format('<origin rpy="0 0 1_0"/>')}, "link 'b': expected <origin rpy=/> as 3 numbers"),
        ({"inside": BALL.format('<origin xyz="0 0"/>')}, "link 'b': expected <origin xyz=/> as 3 numbers"),
        ({"inside": BALL.format("<geometry><box size='1 1 1'/></geometry>")}, "got <box>, <sphere>"),
        ({"inside": BALL.replace("0.1", "0x1").format("")}, "sizes above 0"),
        ({"inside": '<collision><geometry><mesh filename="a" scale="1,1,1"/></geometry></collision>'}, "to be a mesh"),
        ({"inside": f'<inertial><mass value="1"/>{INERTIA.replace("ixy", "xy")}</inertial>'}, "; ixy cannot be read"),
        ({"inside": f'<inertial><origin xyz="a b c"/><mass value="1"/>{INERTIA}</inertial>'}, "'b': expected <origin"),
        ({"axis": '0 0 1"/><origin xyz="0;0;1'}, "joint 'j': expected <origin xyz=/>"),
        ({"axis": '0 0 1"/><orgin xyz="0 0 1'}, "joint 'j': expected <origin>, got <orgin>, which readers of URDF"),
        ({"axis": '0 0 1"/><origin pos="0 0 1'}, "joint 'j': expected <origin xyz= rpy=/>, got pos=, which readers"),
        ({"axis": '0 0 1"/><origin rpy="0 90 0'}, "joint 'j': expected <origin rpy=/> in radians, got '0 90 0'; are"),
        ({"axis": '1 0 0"/><axes xyz="0 0 1'}, "joint 'j': expected <axis>, got <axes>"),
        ({"inside": BALL.format('<Origin xyz="0 0 1"/>')}, "link 'b': expected <origin>, got <Origin>"),
        ({"velocity": "1_0"}, "joint 'j': expected a number for velocity, got '1_0'"),
        ({"inside": "<x>" * 50_000 + "</x>" * 50_000}, "elements within one another"),
        ({"before": '<!DOCTYPE r [<!ENTITY e SYSTEM "file:///etc/passwd">]>'}, "declares a document type"),
        ({"axis": "0 0 0"}, "joint 'j': expected <axis xyz=/> as three numbers that are not all 0, got '0 0 0'"),
        ({"axis": "nan 0 0"}, "joint 'j': expected <axis"),
        ({"name": ""}, "a name of each joint that moves"),
        ({"velocity": "1e-320"}, "joint 'j': expected limits of at least 1e-09"),
    ],
)  # fmt: skip
def test_what_would_be_left_out_without_a_word_is_refused_by_name(tmp_path, changed, words):
    path = urdf(tmp_path, **changed)
    with pytest.raises(DataError, match=words):
        load(path, tip="b")


@pytest.mark.parametrize("axis", ['xzy="0 0 1"', ""])
def test_an_axis_without_its_numbers_is_refused(tmp_path, axis):
    path = urdf(tmp_path)
    path.write_text(path.read_text().replace('xyz="0 0 1"', axis))
    with pytest.raises(DataError, match="joint 'j': expected <axis xyz=/> as three numbers"):
        load(path)


def test_numbers_that_may_be_in_other_units_and_joints_that_float_are_said(tmp_path):
    path = urdf(tmp_path, axis='0 0 1"/><origin xyz="0 0 400')
    base = '<link name="w"/><joint name="base" type="floating"><parent link="w"/><child link="a"/></joint>'
    text = path.read_text().replace('lower="-1" upper="1"', 'lower="-170" upper="170"')
    path.write_text(text.replace("</robot>", f"{base}</robot>"))
    assert load(path).assumed[:3] == (
        "j may turn from -170 to 170 rad: if the file means degrees, write radians",
        "the arm is 400 m long: if the file means millimeters, write meters",
        "base can move freely or in a plane: locked, no part of the arm",
    )


def test_what_a_reader_leaves_out_all_the_same_is_refused(tmp_path, monkeypatch):
    """As if the library for kinematics read less than we looked at."""
    import pinocchio

    path = urdf(tmp_path, BALL.format(""))
    read = pinocchio.buildGeomFromUrdfString

    def nothing(*arguments, **options):
        shapes = read(*arguments, **options)
        shapes.removeGeometryObject("b_0")
        return shapes

    with monkeypatch.context() as patch:
        patch.setattr(pinocchio, "buildGeomFromUrdfString", nothing)
        with pytest.raises(DataError, match="link 'b': expected 1 collision shapes, but 0 can be read"):
            load(path)
    path = urdf(tmp_path, f'<inertial><mass value="2"/>{INERTIA}</inertial>')
    build = pinocchio.buildModelFromXML
    monkeypatch.setattr(pinocchio, "buildModelFromXML", lambda text: build(text.replace('value="2"', 'value="1"')))
    with pytest.raises(DataError, match="joint 'j': expected it to move links of 2 kg together, but 1 kg can be read"):
        load(path)


def test_a_mesh_whose_name_no_file_can_have_is_not_there(tmp_path):
    mesh = f'<collision><geometry><mesh filename="{"a" * 5000}"/></geometry></collision>'
    assert load(urdf(tmp_path, mesh)).assumed[0] == "b has no shape: its mesh is not there"


def test_joints_that_move_nothing_with_a_mass_are_named(tmp_path):
    path = tmp_path / "arm.urdf"
    links = f'<link name="a"/><link name="b"><inertial><mass value="1"/>{INERTIA}</inertial></link><link name="c"/>'
    first = JOINT.format(name="j", axis="0 0 1", velocity=1)
    second = first.replace('"b"', '"c"').replace('"a"', '"b"').replace('"j"', '"k"')
    path.write_text(f'<robot name="r">{links}{first}{second}</robot>')
    robot = load(path)
    still = np.zeros((3, 2))
    report = preflight(robot, JointTrajectory(robot.joints, np.arange(3.0), still, still, still, {}))
    assert "the weight of what k move: the model has no masses there" in report.unchecked
