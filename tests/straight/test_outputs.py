"""A folder of straight pictures holds what the last run wrote, and what was there before any."""

from __future__ import annotations

from orthoscope.straight.outputs import LIST, replace_outputs


def test_what_an_earlier_run_wrote_and_this_one_does_not_is_removed_and_nothing_else(tmp_path):
    for name in ("a.png", "b.png", "mine.png"):
        (tmp_path / name).write_text(name)
    assert replace_outputs(tmp_path, [tmp_path / "a.png", tmp_path / "b.png"], []) == []
    assert replace_outputs(tmp_path, [tmp_path / "a.png"], []) == [tmp_path / "b.png"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "mine.png", LIST]


def test_an_input_and_a_place_elsewhere_are_never_removed(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "precious").write_text("mine")
    (tmp_path / "out/a.png").write_text("a")
    replace_outputs(tmp_path / "out", [tmp_path / "out/a.png"], [])
    text = (tmp_path / "out" / LIST).read_text()
    (tmp_path / "out" / LIST).write_text(text + "../precious\n..\n\n")
    assert replace_outputs(tmp_path / "out", [], [tmp_path / "out/a.png"]) == []
    assert (tmp_path / "precious").exists()
    assert (tmp_path / "out/a.png").exists()


def test_a_list_of_another_program_is_left_alone(tmp_path):
    (tmp_path / LIST).write_text("a.png\n")
    (tmp_path / "a.png").write_text("a")
    assert replace_outputs(tmp_path, [], []) == []
    assert (tmp_path / "a.png").exists()
