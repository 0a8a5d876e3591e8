import re
import time

import pytest

from taskcal.errors import FileError
from taskcal.robot.catalogue import load_robot
from taskcal.robot.importers import xacro

MACRO = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
 <xacro:macro name="arm" params="prefix length">
  <link name="${prefix}base"/><link name="${prefix}tool0"/>
  <joint name="${prefix}j1" type="continuous">
   <origin xyz="0 0 ${2 * length}"/><parent link="${prefix}base"/><child link="${prefix}tool0"/><axis xyz="0 0 1"/>
  </joint>
 </xacro:macro>
</robot>
"""
CELL = """<robot name="cell" xmlns:xacro="http://www.ros.org/wiki/xacro">
 <xacro:include filename="$(find arm_support)/urdf/arm_macro.xacro"/>
 <xacro:arm prefix="left_" length="0.25"/>
</robot>
"""


@pytest.fixture
def packages(tmp_path):
    """Two ROS packages beside each other."""
    for name, file, text in (("arm_support", "arm_macro.xacro", MACRO), ("cell", "cell.urdf.xacro", CELL)):
        (tmp_path / name / "urdf").mkdir(parents=True)
        (tmp_path / name / "urdf" / file).write_text(text, encoding="utf-8")
        (tmp_path / name / "package.xml").write_text(f"<package><name>{name}</name></package>", encoding="utf-8")
    return tmp_path


def test_macros_and_packages_beside_are_carried_out(packages):
    robot = load_robot(packages / "cell" / "urdf" / "cell.urdf.xacro", trust_xacro=True)
    assert robot.joint_names == ("left_j1",)
    assert robot.joints[0].before[0].transform[2, 3] == pytest.approx(0.5, abs=1e-15)


def test_without_the_package_it_says_how_to_get_it(packages, monkeypatch):
    monkeypatch.setattr(xacro, "find_spec", lambda name: None)
    with pytest.raises(FileError, match=r"takes the package xacrodoc: pip install 'taskcal\[urdf\]'"):
        load_robot(packages / "cell" / "urdf" / "cell.urdf.xacro")


def test_macros_that_fail_say_why(packages):
    (packages / "cell" / "urdf" / "cell.urdf.xacro").write_text(CELL.replace("0.25", "${nothing}"), encoding="utf-8")
    with xacro.trusting_xacro(), pytest.raises(FileError, match=r"xacro macro expansion failed: .*nothing"):
        load_robot(packages / "cell" / "urdf" / "cell.urdf.xacro")


def test_macros_without_end_are_given_up(packages, monkeypatch):
    monkeypatch.setattr(xacro, "SECONDS", 1.0)
    (packages / "cell" / "urdf" / "cell.urdf.xacro").write_text(CELL.replace("0.25", "${9**9**9}"), encoding="utf-8")
    began = time.monotonic()
    with xacro.trusting_xacro(), pytest.raises(FileError, match=r"do not come to an end|xacro macro expansion failed"):
        load_robot(packages / "cell" / "urdf" / "cell.urdf.xacro")
    assert time.monotonic() - began < 5.0


@pytest.mark.parametrize("name", ["arm.xacro", "../shared/arm.xacro", "$(cwd)/arm.xacro"])
def test_files_beside_are_found_from_anywhere(name, tmp_path):
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared" / "arm.xacro").write_text(MACRO, encoding="utf-8")
    path = tmp_path / "shared" / "main.xacro"
    path.write_text(CELL.replace("$(find arm_support)/urdf/arm_macro.xacro", name), encoding="utf-8")
    assert load_robot(path).joint_names == ("left_j1",)


SECRET = "the-content-of-a-file-elsewhere"
ARM = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">%s
 <link name="base"/><link name="tool0"/>
 <joint name="j1" type="continuous">
  <origin xyz="0 0 ${%s}"/><parent link="base"/><child link="tool0"/><axis xyz="0 0 1"/>
 </joint>
</robot>
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A xacro file's folder; beside it a file and in the environment a variable that are not the file's."""
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "secret.yaml").write_text(SECRET, encoding="utf-8")
    (tmp_path / "elsewhere" / "arm.xacro").write_text(ARM % ("", "1"), encoding="utf-8")
    monkeypatch.setenv("TOKEN_OF_THE_USER", SECRET)
    folder = tmp_path / "own"
    folder.mkdir()
    (folder / "link.yaml").symlink_to(tmp_path / "elsewhere" / "secret.yaml")
    (folder / "link").symlink_to(tmp_path / "elsewhere")
    (folder / ".hidden.yaml").write_text(SECRET, encoding="utf-8")
    (folder / "sizes.yaml").write_text(
        "arm: {length: 0.5, parts: [0.1, 0.2]}\ntext: '{0.__globals__[os].environ}'", encoding="utf-8"
    )
    return folder


def shown_by(folder, expression="0", before=""):
    """What a page would show of the robot, or of the error, for an expression in a xacro file."""
    name = f'<link name="{expression}"/><joint name="n" type="fixed"><parent link="tool0"/><child link="{expression}"/></joint>'
    path = folder / "arm.xacro"
    path.write_text(
        (ARM % (before + name, "1")).replace("ELSEWHERE", str(folder.parent / "elsewhere")), encoding="utf-8"
    )
    try:
        return repr(load_robot(path)) + xacro.expand_xacro(path).decode()
    except FileError as error:
        return str(error)


HOSTILE = {
    "load_yaml": "${xacro.load_yaml('ELSEWHERE/secret.yaml')}",
    "load_yaml_old_name": "${load_yaml('ELSEWHERE/secret.yaml')}",
    "load_yaml_above": "${load_yaml('../elsewhere/secret.yaml')}",
    "load_yaml_link": "${load_yaml('link.yaml')}",
    "load_yaml_folder_link": "${load_yaml('link/secret.yaml')}",
    "load_yaml_hidden": "${load_yaml('.hidden.yaml')}",
    "load_yaml_process": "${load_yaml('/proc/self/environ')}",
    "load_yaml_open_file": "${load_yaml(0)}",
    "env": "$(env TOKEN_OF_THE_USER)",
    "optenv": "$(optenv TOKEN_OF_THE_USER none)",
    "eval_env": "$(eval env('TOKEN_OF_THE_USER'))",
    "eval_builtin": "$(eval open)",
    "import": "${__import__('os').environ}",
    "open": "${open('ELSEWHERE/secret.yaml').read()}",
    "class": "${().__class__.__base__.__subclasses__()}",
    "class_in_comprehension": "${[x.__class__.__base__.__subclasses__() for x in [()]]}",
    "class_in_lambda": "${(lambda x: x.__class__.__base__.__subclasses__())(())}",
    "globals_in_comprehension": "${[f.__globals__['os'].environ['TOKEN_OF_THE_USER'] for f in [load_yaml]]}",
    "frames": "${[g.gi_frame.f_back.f_builtins['open']('ELSEWHERE/secret.yaml').read() for g in [(i for i in [1])]]}",
    "format": "${load_yaml('sizes.yaml').text.format(xacro.tokenize)}",
    "format_map": "${load_yaml('sizes.yaml').text.format_map(python)}",
    "format_of_the_class": "${python.list(map(python.str.format, [load_yaml('sizes.yaml').text], [xacro.tokenize]))}",
    "vars": "${python.vars(python.type)['__subclasses__'](python.type(1).mro()[-1])}",
    "made_class": "${python.type('A', (dict,), dict())}",
}


@pytest.mark.parametrize("expression", HOSTILE.values(), ids=HOSTILE)
def test_xacro_reads_nothing_outside_its_folder(expression, own):
    text = shown_by(own, expression)
    assert SECRET not in text
    assert "subclasses" not in text.partition("evaluates")[0]
    assert "arm.xacro: " in text
    assert re.search(r"give --trust-xacro$|xacro macro expansion failed: ", text), text


@pytest.mark.parametrize(
    "name",
    ["ELSEWHERE/arm.xacro", "../elsewhere/arm.xacro", "link/arm.xacro", "../else*/arm.xacro", "ELSEWHERE/a[r]m.xacro"],
)
def test_xacro_includes_nothing_outside_its_folder(name, own):
    optional = f'<xacro:include filename="{name}" optional="true"/>'
    assert re.search(r"(reads|lists) '.*(elsewhere|link/arm|/\.\.)", shown_by(own, before=optional))


def test_xacro_of_a_package_elsewhere_is_refused_by_name(packages):
    with pytest.raises(FileError, match=r"package 'arm_support', which is not in the file's own folder; .*-xacro"):
        load_robot(packages / "cell" / "urdf" / "cell.urdf.xacro")


def test_xacro_included_entities_do_not_grow_without_end(own):
    levels = "".join(f'<!ENTITY e{i + 1} "{f"&e{i};" * 10}">' for i in range(12))
    doctype = f'<!DOCTYPE robot [<!ENTITY e0 "x"><!ENTITY f SYSTEM "ELSEWHERE/secret.yaml">{levels}]>'
    (own / "laughs.xacro").write_text(f'{doctype}<robot><link name="&e12;"/></robot>', encoding="utf-8")
    text = shown_by(own, before='<xacro:include filename="laughs.xacro"/>')
    assert "xacro macro expansion failed" in text
    doctype = f'<!DOCTYPE robot [<!ENTITY f SYSTEM "{own.parent}/elsewhere/secret.yaml">]>'
    (own / "outside.xacro").write_text(f"{doctype}<robot><link>&f;</link></robot>", encoding="utf-8")
    assert SECRET not in shown_by(own, before='<xacro:include filename="outside.xacro"/>')


def test_xacro_of_its_own_folder_is_carried_out(own):
    """What sound files use: YAML, packages below, packages around, globs, comprehensions, arguments, the library of mathematics."""
    (own / "package.xml").write_text("<package format='3'><name> cell </name></package>", encoding="utf-8")
    (own / "parts" / "urdf").mkdir(parents=True)
    (own / "parts" / "package.xml").write_text("<package><name>parts</name></package>", encoding="utf-8")
    (own / "parts" / "urdf" / "arm_macro.xacro").write_text(MACRO, encoding="utf-8")
    (own / "urdf").mkdir()
    path = own / "main.xacro"
    path.write_text(
        """<robot name="cell" xmlns:xacro="http://www.ros.org/wiki/xacro">
        <xacro:arg name="prefix" default="left_"/>
        <xacro:arg name="half" default="0.5"/>
        <xacro:property name="sizes" value="${xacro.load_yaml('$(find cell)/sizes.yaml')}"/>
        <xacro:property name="total" value="${sum([p for p in sizes.arm.parts]) if False else sizes['arm']['length']}"/>
        <xacro:property name="rounded" value="${round(sin(pi / 2) * math.cos(0) * total + python.abs(-0.0), 3)}"/>
        <xacro:include filename="$(find parts)/urdf/*_macro.xacro"/>
        <xacro:arm prefix="$(arg prefix)" length="${rounded * $(eval half)}"/>
        <xacro:if value="${python.type(1) == python.type(2) and '%s' % xacro.arg('prefix') == 'left_'}">
         <link name="l"/><joint name="f" type="fixed"><parent link="left_tool0"/><child link="l"/></joint>
        </xacro:if>
        </robot>""",
        encoding="utf-8",
    )
    robot = load_robot(path)
    assert robot.joint_names == ("left_j1",)
    assert robot.joints[0].before[0].transform[2, 3] == pytest.approx(0.5, abs=1e-12)


def test_xacro_that_is_trusted_reads_what_it_names(own):
    with xacro.trusting_xacro():
        assert SECRET in shown_by(own, "${load_yaml('ELSEWHERE/secret.yaml')}")
        assert SECRET in shown_by(own, "$(env TOKEN_OF_THE_USER)")
    assert SECRET not in shown_by(own, "$(env TOKEN_OF_THE_USER)")


def test_xacro_that_grows_beyond_bounds_is_given_up(own):
    assert re.search(r"make more than 10 MB|take more than", shown_by(own, "${'x' * 20000000}"))


def test_xacro_that_prints_without_end_fills_no_memory(own, monkeypatch):
    """Messages of macros are not kept by the process that waits for them."""
    monkeypatch.setattr(xacro, "SECONDS", 2.0)
    kept = []
    run = xacro.subprocess.run

    def watched(*arguments, **named):
        done = run(*arguments, **named)
        kept.append(len(done.stderr))
        return done

    monkeypatch.setattr(xacro.subprocess, "run", watched)
    shown_by(own, "${[xacro.message('x' * 100000) for i in python.range(200)][0]}l")
    assert kept
    assert max(kept) < 1000
