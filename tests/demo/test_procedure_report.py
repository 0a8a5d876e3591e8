import re

from taskcal.demo.procedure import Procedure
from taskcal.demo.procedure_report import procedure_html, summary_points


def test_the_page_has_every_part_and_no_number_that_is_none(procedure: Procedure) -> None:
    page = procedure_html(procedure, next_steps="taskcal identify …", version="0")
    body = page[page.index("<body>") :]
    assert re.findall(r"<h2>(\d)", body) == [str(k) for k in range(1, 10)]
    assert body.count("<figure>") == 8
    assert body.count("<details>") == 4
    texts = re.sub(r"<script.*?</script>", "", body, flags=re.DOTALL)
    assert not re.search(r"\bnan\b|\binf\b|\bNone\b", texts)
    assert "taskcal identify …" in texts


def test_the_summary_says_what_this_run_found(procedure: Procedure) -> None:
    said = " ".join(summary_points(procedure))
    assert "Only 24 can be told apart in one tool orientation, 25 when" in said
