"""What the fit of the geometry is looked at for: each kind of mistake is said, and nothing of a sound robot and sound rows."""

import ast
import copy
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import taskcal
from taskcal.campaigns.campaign import Campaign
from taskcal.errors import FitError, TaskcalError
from taskcal.identification.checks import checks
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.registration.registration import register
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import EncoderGain
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.virtual.cell import simulate
from tests.diagnosis.virtual_campaigns import HEALTHY, virtual
from tests.laws.robots import irb6660_positions
from tests.realdata.test_effects import campaign_of

ROBOTS = (
    "ur5e",
    "abb-irb120",
    "franka-panda",
    "kuka-kr120-r2500-pro",
    "fanuc-lrmate-200id",
    "staubli-rx160",
    "abb-irb6660-205-1.9",
    "motoman-gp12",
    "ufactory-xarm6",
    "kinova-gen3",
)
LENGTHS = ("a_mm", "d_mm", "tx_mm", "ty_mm", "tz_mm")
VISIBLE = 5e-4
"""Residual of an else nominal robot, metres, from which on a wrong length is nothing that tracker frame and target take up."""


def poses(robot, rng, count=60):
    if robot.four_bar is not None:
        return irb6660_positions(rng, count)
    return rng.uniform(*np.clip(robot.limits, -2.8, 2.8).T, (count, len(robot.joints)))


def measured(robot, rng, scale, lever=0.05):
    """Sixty poses of a robot whose defects are so many of its tolerances, with a target so far off its last axis."""
    model = ErrorModel(robot)
    x = rng.normal(size=len(model)) * model.tolerances * scale
    target = {"smr": np.array([0.8 * lever, 0.6 * lever, 0.05])}
    return simulate(model, poses(robot, rng), rng=rng, x=x, targets=target, model_error=3e-5)[0]


def lengths(robot):
    """Where the robot file states a length that is not zero: joint, and the keys below it."""
    for number, joint in enumerate(robot.description["joint"]):
        for style in ("dh", "mdh"):
            yield from ((number, style, key) for key in LENGTHS if joint.get(style, {}).get(key))
        for k, step in enumerate(joint.get("steps", ())):
            yield from ((number, "steps", k, key) for key in LENGTHS if step.get(key))


def with_length(robot, place, by_mm):
    """The robot with another length in its file."""
    description = copy.deepcopy(dict(robot.description))
    section = description["joint"][place[0]]
    for key in place[1:-1]:
        section = section[key]
    section[place[-1]] += by_mm
    return robot_from(description)


def visible(robot, wrong):
    """Whether a wrong length leaves anything that tracker frame and target do not take up."""
    return register(ErrorModel(wrong), measured(robot, np.random.default_rng(0), 0.0)).rms > VISIBLE


def named(name, scale, seed, place):
    """Whether a length that is wrong by 5 mm is said, as one that is off by so much; None where it is not visible."""
    robot, rng = load_robot(name), np.random.default_rng(seed)
    by = float(rng.choice([-5.0, 5.0]))
    wrong = with_length(robot, place, by)
    if not visible(robot, wrong):
        return None
    doubts = identify(ErrorModel(wrong), measured(robot, rng, scale)).doubts
    return any("compare this length of the robot file" in doubt for doubt in doubts)


@pytest.mark.parametrize("name", ROBOTS[:3])
def test_a_length_of_the_robot_file_that_is_5_mm_wrong_is_said(name):
    """Of robots within half their tolerances; not what tracker frame and target take up."""
    places = list(lengths(load_robot(name)))
    chosen = np.random.default_rng(0).permutation(len(places))[:3]
    said = [named(name, 0.5, seed, places[k]) for seed, k in enumerate(chosen)]
    assert any(said)
    assert False not in said


@pytest.mark.long
@pytest.mark.parametrize(("scale", "share"), [(0.3, 0.99), (0.5, 0.99), (1.0, 0.5)])
def test_wrong_lengths_of_ten_robots_are_said(scale, share):
    """Where the tolerances are met with nothing to spare, five of them are not far from what chance does to one of ten lengths."""
    said = [
        named(name, scale, seed, place) for name in ROBOTS for place in lengths(load_robot(name)) for seed in range(3)
    ]
    said = [one for one in said if one is not None]
    assert len(said) > 100
    assert np.mean(said) >= share


@pytest.mark.parametrize("robots", [1, pytest.param(40, marks=pytest.mark.long)])
def test_a_sound_robot_is_not_doubted(robots):
    """At its tolerances, where chance alone makes one in a hundred; and no robot well within them."""
    doubted = []
    for name in ROBOTS:
        for seed in range(robots):
            rng = np.random.default_rng(1000 + seed)
            doubted.append(bool(identify(ErrorModel(load_robot(name)), measured(load_robot(name), rng, 1.0)).doubts))
            rng = np.random.default_rng(2000 + seed)
            assert not identify(ErrorModel(load_robot(name)), measured(load_robot(name), rng, 0.5)).doubts
    assert np.sum(doubted) <= max(0.02 * len(doubted), 1)


@pytest.mark.parametrize(("name", "other"), [("ur5", "ur5e"), ("ur5e", "ur5"), ("ur10", "ur10e"), ("ur10e", "ur10")])
def test_another_variant_of_the_catalogue_is_named(name, other):
    campaign = measured(load_robot(name), np.random.default_rng(0), 0.5)
    doubts = identify(ErrorModel(load_robot(other)), campaign).doubts
    assert any(doubt.endswith(f"identify with --robot {name}") for doubt in doubts)


def gross(robot):
    """Joints that are counted otherwise than the robot file has it: a sign, a zero, an order, a coupling."""
    n, last = len(robot.joints), len(robot.joints) - 1
    reversed_last, coupled, swapped, zero = np.eye(n), np.eye(n), np.eye(n), np.zeros(n)
    reversed_last[last, last] = -1.0
    coupled[last, last - 1] = 1.0
    swapped[[last - 1, last]] = swapped[[last, last - 1]]
    zero[last - 1] = np.radians(20.0)
    yield from ((reversed_last, 0.0), (coupled, 0.0), (swapped, 0.0), (np.eye(n), zero))


def told(fit, campaign):
    """What a fit doubts; or its refusal."""
    try:
        return fit(campaign).doubts
    except TaskcalError as refusal:
        return (str(refusal),)


@pytest.mark.parametrize(("name", "lever"), [("abb-irb120", 0.01), ("kuka-kr120-r2500-pro", 0.05)])
def test_gross_mistakes_are_refused_or_doubted_before_effects(name, lever):
    """Whatever effects could make of it, from a target on that is a centimetre off the last axis."""
    robot = load_robot(name)
    model, sound = ErrorModel(robot), measured(robot, np.random.default_rng(5), 0.5, lever)
    assert not identify(model, sound).doubts
    for matrix, shift in gross(robot):
        wrong = replace(sound, q=sound.q @ matrix.T + shift)
        said = told(lambda campaign: identify(model, campaign), wrong)
        assert any("taskcal doctor" in words for words in said)
        assert (
            told(lambda campaign: explain(model, campaign, effects=[EncoderGain()], folds=2).calibration, wrong) == said
        )


def test_a_geometry_that_explains_nothing_is_refused_before_effects():
    robot, rng = load_robot("kuka-kr120-r2500-pro"), np.random.default_rng(0)
    sound = measured(robot, rng, 1.0, lever=0.03)
    wrong = replace(sound, q=sound.q * [1.0, 1.0, 1.0, 1.0, 1.0, -1.0])
    for fit in (identify, explain):
        with pytest.raises(FitError, match="no parameter is determined"):
            fit(ErrorModel(robot), wrong)


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("name", "rows", "other", "words"),
    [
        ("ur5", 7, "ur5", ()),
        ("ur10", 10, "ur10", ()),
        ("abb-irb120", 5, "abb-irb120", ()),
        ("fanuc-r2000ic-165f", 1, "fanuc-r2000ic-165f", ()),
        ("ur5", 7, "ur5e", ("compare this length", "--robot ur5")),
        ("ur10", 10, "ur10e", ("compare this length", "--robot ur10")),
    ],
)
def test_measured_robots_are_doubted_where_their_file_is_not_theirs(data_folder, name, rows, other, words):
    campaign = campaign_of(data_folder, name)
    doubts = identify(ErrorModel(load_robot(other)), campaign.take(slice(None, None, rows))).doubts
    assert len(doubts) == len(words)
    assert all(word in doubt for word, doubt in zip(words, doubts, strict=True))


HEALTHY_ROBOTS = ["ur5e", *(pytest.param(name, marks=pytest.mark.long) for name in HEALTHY[1:])]


@pytest.mark.parametrize("scatter_m", [2e-5, pytest.param(1e-4, marks=pytest.mark.long)])
@pytest.mark.parametrize("name", HEALTHY_ROBOTS)
def test_the_controllers_own_positions_are_named_however_they_scatter(name, scatter_m):
    model, rng = ErrorModel(load_robot(name)), np.random.default_rng(1)
    sound = virtual(name, 1)
    shown = model.poses(sound.q)[:, None, :3, 3] + rng.normal(scale=scatter_m, size=sound.points.shape)
    assert "controller or a simulation calculates" in identify(model, replace(sound, points=shown)).remarks[0]


@pytest.mark.parametrize("name", HEALTHY_ROBOTS)
def test_what_an_instrument_measured_in_the_base_is_not_called_calculated(name):
    model = ErrorModel(load_robot(name))
    measured = simulate(
        model, virtual(name, 1).q, rng=np.random.default_rng(1), T_tracker_base=np.eye(4), model_error=5e-5
    )[0]
    assert not any("calculates" in remark for remark in identify(model, measured).remarks)


@pytest.mark.parametrize("name", HEALTHY_ROBOTS)
def test_an_uncertainty_far_beyond_the_residuals_is_named_with_what_it_would_be(name):
    """Micrometres that are read as millimetres; what an instrument states with k = 2 is not called wrong."""
    model = ErrorModel(load_robot(name))
    sound = simulate(model, virtual(name, 1).q, rng=np.random.default_rng(1), targets={"a": np.full(3, 0.05)})[0]

    def remarks(u_m: float) -> str:
        return " ".join(identify(model, replace(sound, uncertainty=np.full((len(sound), 1), u_m))).remarks)

    said = remarks(15e-3)
    assert "column u_mm states an uncertainty of 15 mm" in said
    assert "15 µm are 0.015 mm" in said
    assert "u_mm" not in remarks(4e-5)


@pytest.mark.parametrize("name", HEALTHY_ROBOTS)
def test_rows_that_were_copied_are_counted_and_shots_are_not(name):
    """In any order, whatever their ids; repeated shots differ by the noise, and rows without a point are no copies."""
    rng, model = np.random.default_rng(2), ErrorModel(load_robot(name))
    sound = simulate(model, virtual(name, 1).q, rng=rng, lost=0.1)[0]
    n = len(sound)
    twice = rng.permutation(np.r_[np.arange(n), np.arange(5)])
    ids = tuple(map(str, range(n + 5)))
    copied = Campaign(ids=ids, q=sound.q[twice], targets=sound.targets, points=sound.points[twice])
    seen = int(sound.valid[:5].sum())
    assert any(f"{seen} of {n + 5} rows have the joint values" in one for one in identify(model, copied).remarks)
    shots = replace(copied, points=copied.points + rng.normal(scale=1e-6, size=copied.points.shape))
    for healthy in (sound, shots):
        assert not any("have the joint values" in one for one in identify(model, healthy).remarks)


SAFEGUARDS = [one for one in vars(checks).values() if isinstance(one, checks.Safeguard)]
PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "messages.md"
ELSEWHERE = (
    "campaigns/campaign",
    "estimation/least_squares",
    "identification/checks/course",
    "identification/effects",
    "identification/hyperparameters",
    "reading/reader",
    "registration/length_scale",
    "registration/plausibility",
    "registration/rotations",
)
"""Modules that say the others of the page's messages: what files, campaigns and registrations are refused for, and what fills a
safeguard's words."""


def with_gaps(text):
    """A template with its places as the page has them."""
    return re.sub(r"\{[^}]*\}", "…", text)


def said_by(module):
    """Every text of a module, with gaps for what it is filled with."""
    for node in ast.walk(ast.parse((Path(taskcal.__file__).parent / f"{module}.py").read_text(encoding="utf-8"))):
        if isinstance(node, ast.JoinedStr):
            yield "".join(str(part.value) if isinstance(part, ast.Constant) else "…" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield with_gaps(node.value)


def listed_under(*titles):
    """Messages that the page has in the tables of some chapters."""
    chapters = re.split(r"^## ", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    rows = [line for text in chapters if text.split("\n", 1)[0] in titles for line in text.splitlines()]
    return {one for row in rows if row.startswith("| `") for one in re.findall("`([^`]+)`", row.split(" | ")[0])}


def is_said(message, text):
    parts = [re.escape(part.strip()) for part in message.split("…") if part.strip(" .")]
    return re.search(".*".join(parts), text, re.DOTALL) is not None


def test_the_page_of_messages_lists_every_safeguard_and_nothing_that_nobody_says():
    """Refusals among the errors, all others among the remarks; what safeguards do not say, the rooms do that are named here."""
    errors, remarks = listed_under("Errors"), listed_under("Remarks", "`robot file in doubt`")
    for one in SAFEGUARDS:
        if re.search("[a-z]{2}", re.sub(r"\{[^}]*\}", "", one.template)):
            listed = errors if one.does == "refuses" else remarks
            assert any(is_said(message, with_gaps(one.template)) for message in listed), one.template
    said = [
        *(with_gaps(one.template) for one in SAFEGUARDS),
        *(text for module in ELSEWHERE for text in said_by(module)),
    ]
    assert [message for message in errors | remarks if not any(is_said(message, text) for text in said)] == []
    assert len(errors) > 8
    assert len(remarks) > 20


@pytest.mark.parametrize("module", ["fit", "group_search", "identify", "sibling"])
def test_no_safeguard_stands_beside_the_others(module):
    """What refuses a fit, or remarks something of it, is made of a `Safeguard`."""
    path = Path(taskcal.__file__).parent / "identification" / f"{module}.py"
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        assert not (isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)), f"{module}:{node.lineno}"
        assert not (isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Said"), f"{module}:{node.lineno}"
