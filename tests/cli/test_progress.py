"""Progress where there is no terminal: nothing, or a line now and then."""

from __future__ import annotations

import pytest

from orthoscope.cli.shared import progress


@pytest.mark.parametrize(("lines", "seconds", "told"), [(False, 0.0, 0), (True, 3600.0, 0), (True, 0.0, 3)])
def test_work_of_minutes_tells_a_line_now_and_then(monkeypatch, capsys, lines, seconds, told):
    monkeypatch.setattr(progress, "LINE_EVERY", seconds)
    with progress.bar("experiments", lines=lines) as show:
        for done in (1, 2, 3):
            show(done, 3)
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == told
    assert not errors or errors[-1].startswith("experiments 3 of 3, ")
