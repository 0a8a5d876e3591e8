"""The pages that answer integrators' questions show what their own blocks print, here of one robot."""

import re
from pathlib import Path

import pytest

GUIDES = Path(__file__).parents[2] / "docs" / "how-to"
NUMBER = r"\d+(?:\.\d+)?"
ROBOTS = 1
"""Robots, in place of the pages' ten or twenty: what they show is then right within a factor of two."""


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (GUIDES / page).read_text(encoding="utf-8"), re.DOTALL)


def rows(page: str, begins: str) -> list[list[float]]:
    """Numbers of the lines of a page's tables that begin in a way."""
    text = (GUIDES / page).read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if re.match(rf"\| {begins}", line)]
    return [[float(n) for n in re.findall(NUMBER, line)] for line in lines]


@pytest.fixture
def printed(tmp_path, monkeypatch, capsys):
    """What the block of a page prints in a folder with the task files that the pages tell of, robots being few."""

    def run(page: str, robots: int = ROBOTS) -> list[str]:
        (task,) = blocks("one-reflector-or-three.md", "toml")
        (here,) = blocks("worse-elsewhere.md", "toml")
        single = re.sub(r"(cone|spin)_deg.*\n", "", task).replace('"tilted"', '"one"')
        elsewhere = re.sub("center_mm = .*", "center_mm = [250.0, 350.0, 450.0]", here)
        files = {"task": task, "one": single, "here": here, "elsewhere": elsewhere}
        for name, text in files.items():
            (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
        monkeypatch.chdir(tmp_path)
        (block,) = blocks(page, "python")
        fewer, replaced = re.subn(r"for seed in range\(\d+\)", f"for seed in range({robots})", block)
        assert replaced == 1
        exec(compile(fewer, page, "exec"), {"__name__": page})
        return capsys.readouterr().out.splitlines()

    return run


@pytest.mark.filterwarnings("ignore:.*measured numbers for.*")
def test_one_reflector_or_three(printed):
    found = [[float(n) for n in re.findall(NUMBER, line)] for line in printed("one-reflector-or-three.md")]
    said = rows("one-reflector-or-three.md", "(one orientation|tilted and turned)")
    assert len(found) == len(said) == 4
    for (count, mm, _), (said_count, said_mm, _) in zip(found, said, strict=True):
        assert count == said_count
        assert 0.5 < mm / said_mm < 2.0


def test_worse_elsewhere(printed):
    found = [[float(n) for n in re.findall(NUMBER, line)] for line in printed("worse-elsewhere.md", 5)]
    said = rows("worse-elsewhere.md", "(geometric errors only|gear errors)")
    assert len(found) == len(said) == 4
    for robot, page in zip(found, said, strict=True):
        assert all(0.5 < one / other < 2.0 for one, other in zip(robot, page, strict=True))


@pytest.mark.filterwarnings("ignore:.*measured numbers for.*", "ignore:no model error could be told.*")
def test_how_often_again(printed):
    found = {
        (float(mrad), int(count)): (float(share), float(mm))
        for mrad, count, share, mm in re.findall(
            rf"({NUMBER}) mrad, (\d+) poses: shown for (\d+)%, ({NUMBER}) mm",
            "\n".join(printed("compare-calibrations.md")),
        )
    }
    assert len(found) == 9
    said = rows("compare-calibrations.md", rf"{NUMBER} mrad \|")
    for mrad, mm, *shares in said:
        assert 0.5 < found[mrad, 40][1] / mm < 2.0
        for count, share in zip((10, 20, 40), shares, strict=True):
            if share in (0.0, 100.0):
                assert found[mrad, count][0] == share
    assert all(found[0.0, count][0] == 0.0 for count in (10, 20, 40))
