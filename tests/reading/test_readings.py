"""Files that hold joints, points or both, in the forms that instruments write."""

from hypothesis import given
from hypothesis import strategies as st

from taskcal.errors import TaskcalError
from taskcal.reading.readings import read_readings
from tests.reading.measured_files import NAMED, ROBOT

text = st.text(st.sampled_from("0123456789.,;:-+eE \t\n\"'#/[]()xyzqJA_m°dégrnai="), max_size=200)


@given(text, st.booleans())
def test_any_text_is_read_or_refused_with_its_name(tmp_path_factory, content, headed):
    path = tmp_path_factory.mktemp("fuzz") / "any.csv"
    path.write_text((NAMED + " x_mm y_mm z_mm\n" if headed else "") + content, encoding="utf-8")
    try:
        read_readings(path, ROBOT)
    except TaskcalError as refusal:
        if "any.csv" not in str(refusal):
            raise


WHOLE = (NAMED.replace(" ", ";") + ";x_mm;y_mm;z_mm\n" + "10,5;20;-30;1;2;3;1000,25;-200;50\n" * 6).encode("utf-16")


@given(st.integers(0, len(WHOLE) - 1), st.binary(max_size=12), st.integers(0, 20))
def test_damaged_bytes_are_read_or_refused(tmp_path_factory, at, noise, dropped):
    path = tmp_path_factory.mktemp("fuzz") / "any.csv"
    path.write_bytes(WHOLE[:at] + noise + WHOLE[at + dropped :])
    try:
        read_readings(path, ROBOT)
    except TaskcalError as refusal:
        if "any.csv" not in str(refusal):
            raise
