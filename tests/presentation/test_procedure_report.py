import re

import numpy as np

from taskcal.adaptation.procedure import Procedure
from taskcal.presentation.predictions import Predictions
from taskcal.presentation.procedure_report import procedure_html, summary_points


def test_the_page_has_every_part_and_no_number_that_is_none(procedure: Procedure) -> None:
    n = 5
    predictions = [
        Predictions(
            campaign=fit.campaign,
            model=fit.model,
            where=where,
            position=np.zeros((n, 3)),
            angle=np.zeros(n),
            error=np.full((n, 3), 1e-5),
            covariance=np.broadcast_to(1e-10 * np.eye(3), (n, 3, 3)),
        )
        for fit in procedure.fits
        for where in ("same orientations", "turned farther")
    ]
    page = procedure_html(procedure, predictions, next_steps="taskcal identify …", version="0")
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
