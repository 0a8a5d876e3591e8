"""Tables of a fleet list those robots that somebody should look at, the most changed first."""

from types import SimpleNamespace

from taskcal.report.fleet import robots_to_look_at, tabulate_fleet, tabulate_fleet_changes, tabulate_outliers_of_fleet


def latest(verdict="good", outliers=(), change="unchanged"):
    return {"verdict": verdict, "outliers": list(outliers), "change": change}


def change(robot, excess, verdict="changed", **resembles):
    found = [{"name": "J3.rz", "amount": 0.25, "unit": "mrad", "share": 0.8}] if resembles else []
    return {
        "robot": robot, "after": f"{robot}/b.json", "verdict": verdict, "rms_mm": 2.0 * excess, "expected_mm": 0.5 * excess,
        "excess_mm": excess, "resembles": found,
    }  # fmt: skip


def test_robots_to_look_at_are_those_that_are_not_as_they_should_be() -> None:
    fleet = SimpleNamespace(
        latest={
            "sound": latest(),
            "small": latest(change="small"),
            "badly measured": latest("too few rows"),
            "unlike": latest(outliers=["J3.rz"]),
            "changed": latest(change="changed"),
        }
    )
    assert robots_to_look_at(fleet) == ["badly measured", "unlike", "changed"]


def test_the_most_changed_robots_come_first() -> None:
    changes = (
        change("a", 0.1),
        change("b", 0.3, resembles=True),
        change("c", 0.9, "unchanged"),
        change("d", 0.2, "small"),
    )
    table = tabulate_fleet_changes(SimpleNamespace(changes=changes))
    assert [row[0] for row in table.rows] == ["b", "d", "a"]
    assert [row[3:5] for row in table.rows] == [("0.600", "0.150"), ("0.400", "0.100"), ("0.200", "0.050")]
    assert table.rows[0][-1] == "J3.rz +0.250 mrad (80 %)"
    assert "(3)" in table.title


def test_calibrations_of_many_robots_are_those_that_need_a_look() -> None:
    """Every one of a small fleet; every figure under its own heading."""
    rows = [
        {
            "robot": f"r{k}", "date": "2026-03-01T10:00", "rows": 40 + k, "nominal_mm": 3.0, "fitted_mm": 0.1, "held_out_mm": 0.2,
            "stated_mm": 0.15, "verdict": "good", "change": "changed" if k == 7 else "", "change_mm": 0.5,
        }
        for k in range(101)
    ]  # fmt: skip
    names = [row["robot"] for row in rows]
    at = {name: latest(change=row["change"]) for name, row in zip(names, rows, strict=True)}

    def of(count):
        few = dict(list(at.items())[:count])
        return SimpleNamespace(folder="f", calibrations=rows[:count], robots=names[:count], latest=few)

    assert len(tabulate_fleet(of(100)).rows) == 100
    (row,) = tabulate_fleet(of(101)).rows
    assert row == ("r7", "2026-03-01", "47", "3.000", "0.100", "0.200", "0.150", "good", "0.500")


def test_outliers_are_listed_with_the_fleet_s_own_figures() -> None:
    outliers = [
        {
            "robot": "b",
            "name": "J3.rz",
            "value": 1.5,
            "fleet_median": -0.25,
            "fleet_spread": 0.125,
            "unit": "mrad",
            "z": -7.25,
        }
    ]
    (row,) = tabulate_outliers_of_fleet(SimpleNamespace(outliers=outliers)).rows
    assert row[2:5] == ("+1.5000", "-0.2500", "0.1250")
