"""A folder of straight pictures keeps what earlier runs wrote, and says which files these are."""

from __future__ import annotations

from orthoscope.straight.outputs import LIST, of_earlier_runs


def test_what_an_earlier_run_wrote_and_this_one_does_not_is_named_and_stays(tmp_path):
    for name in ("a.png", "b.png", "mine.png"):
        (tmp_path / name).write_text(name)
    assert of_earlier_runs(tmp_path, [tmp_path / "a.png", tmp_path / "b.png"]) == []
    assert of_earlier_runs(tmp_path, [tmp_path / "a.png"]) == [tmp_path / "b.png"]
    assert of_earlier_runs(tmp_path, [tmp_path / "a.png"]) == [tmp_path / "b.png"]  # it is remembered
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "b.png", "mine.png", LIST]


def test_what_is_gone_or_elsewhere_is_not_named(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "precious").write_text("mine")
    of_earlier_runs(tmp_path / "out", [tmp_path / "out/a.png"])
    text = (tmp_path / "out" / LIST).read_text()
    (tmp_path / "out" / LIST).write_text(text + "../precious\n..\n\n")
    assert of_earlier_runs(tmp_path / "out", []) == []


def test_a_list_of_another_program_says_nothing(tmp_path):
    (tmp_path / LIST).write_text("a.png\n")
    (tmp_path / "a.png").write_text("a")
    assert of_earlier_runs(tmp_path, []) == []
