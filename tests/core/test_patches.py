"""Patch lists, the player without its screen, and pairing with readings."""

from __future__ import annotations

import csv
import itertools
import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spectral_core.display.measuring.measurements import read_measurements
from spectral_core.display.measuring.patches import (
    PatchList,
    pair,
    published_patches,
    read_patches,
    write_paired,
    write_patches,
)
from spectral_core.display.measuring.playback import (
    SHOWN_FILE,
    STATE_FILE,
    Pace,
    Playback,
    Trigger,
    write_shown,
    write_state,
)
from spectral_core.display.models import srgb_decode
from spectral_core.errors import DisplayError

Run = Callable[..., tuple[int, str, str]]

RGBWK = PatchList(np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [0, 0, 0.0]]), ("r", "g", "b", "w", "k"))


def _file(folder: Path, text: str, name: str = "table.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def _played(patches: PatchList, folder: Path, start: float = 1e9, each: float = 2.0) -> Path:
    """Everything shown once: drawn at once, settled after 1 s, left after `each` seconds."""
    playback = Playback(patches, Pace(settle=1.0))
    now = start
    while not playback.ended:
        playback.drawn(now)
        now += each
        playback.step(1, now)
    return write_shown(playback, folder)


def test_the_published_protocol_has_its_234_patches() -> None:
    patches = published_patches()
    assert len(patches) == len(patches.names) == 234
    levels = 255 * patches.codes
    np.testing.assert_allclose(levels, np.round(levels), atol=1e-9)
    for channel, axis in enumerate(np.eye(3)):
        ramp = levels[52 * channel : 52 * (channel + 1)]
        np.testing.assert_allclose(ramp, np.outer(np.arange(0, 256, 5), axis), atol=1e-9)
    assert (levels == 0).all(axis=1).sum() == 3  # black, three times: its noise
    assert (levels == 255).all(axis=1).sum() == 1
    # A seed's stream may change with numpy: the same protocol must stay the same.
    np.testing.assert_allclose(levels[184:187], PINNED, atol=1e-9)


PINNED = [[193, 193, 127], [240, 169, 151], [133, 81, 155]]


@given(
    codes=st.lists(st.tuples(*[st.floats(0, 1)] * 3), min_size=1, max_size=8),
    names=st.lists(st.text("ab ,;\"'é#", max_size=8), min_size=8, max_size=8),
)
def test_a_written_list_reads_the_same(
    codes: list[tuple[float, float, float]], names: list[str], tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("list") / "patches.csv"
    patches = PatchList(np.array(codes), tuple(name.strip() for name in names[: len(codes)]))
    write_patches(patches, path)
    again = read_patches(path)
    np.testing.assert_allclose(again.codes, patches.codes, rtol=1e-8, atol=0)  # nine digits
    assert again.names == patches.names


def test_lists_of_8_bit_levels_with_names_in_any_order(tmp_path: Path) -> None:
    patches = read_patches(_file(tmp_path, "# mine\nName;B;G;R\nwhite;255;255;255\n\nred;0;0;255\n"))
    np.testing.assert_array_equal(patches.codes, [[1, 1, 1], [1, 0, 0]])
    assert patches.names == ("white", "red")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "holds no rows"),
        ("R,G,B\n", "holds no rows"),
        ("R,G\n1,2\n", "lacks the column B"),
        ("R,G,B\n1,0\n", "line 2: 2 columns, the header has 3"),
        ("R,G,B\n1,0,nan\n", "line 2: 'nan' is no finite number"),
        ("R,G,B\n1,0,0\n300,0,0\n", "line 3: device codes outside"),
        ("R,G,B\n-0.1,0,0\n", "line 2: device codes outside"),
    ],
)
def test_bad_lists_are_refused_with_their_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(DisplayError, match=message):
        read_patches(_file(tmp_path, text))


@given(st.text(max_size=200))
def test_no_text_breaks_the_reader(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.mktemp("fuzz") / "patches.csv"
    path.write_bytes(text.encode("utf-8", "replace"))
    try:
        codes = read_patches(path).codes
    except DisplayError:
        return
    assert ((codes >= 0) & (codes <= 1)).all()


def test_a_patch_settles_after_it_was_drawn_and_the_first_after_the_warm_up() -> None:
    playback = Playback(RGBWK, Pace("TIMER", seconds=3, settle=1, warm_up=10))
    playback.tick(100.0)
    assert playback.state(1e6) == "drawing"  # not drawn: nothing to read, however long it takes
    playback.drawn(0.0)
    playback.drawn(5.0)  # only the first drawing counts
    assert [playback.state(now) for now in (10.9, 11.0)] == ["settling", "ready"]
    playback.tick(13.9)
    assert playback.patch == 0
    playback.tick(14.0)
    assert (playback.patch, playback.state(14.0)) == (1, "drawing")
    playback.drawn(20.0)
    assert [playback.state(now) for now in (20.9, 21.0)] == ["settling", "ready"]


def test_by_file_only_a_touch_of_a_settled_patch_counts() -> None:
    playback = Playback(RGBWK, Pace("FILE", settle=1))
    playback.drawn(0.0)
    playback.tick(0.5, touched=True)
    playback.tick(50.0)
    assert playback.patch == 0
    playback.tick(50.0, touched=True)
    assert playback.patch == 1


def test_keys_go_forward_and_back_and_the_end_is_the_end(tmp_path: Path) -> None:
    playback = Playback(RGBWK, Pace(settle=1))
    seen = []
    for now, by in zip(itertools.count(0, 2), (-1, 1, 1, -1, 1, 1, 1, 1), strict=False):
        playback.drawn(now)
        seen.append(playback.patch)
        playback.step(by, now + 2)
    assert seen == [0, 0, 1, 2, 1, 2, 3, 4]
    assert playback.state(1e9) == "done"
    playback.stop(1e9)
    assert playback.state(1e9) == "done"
    with write_shown(playback, tmp_path).open(encoding="utf-8") as stream:
        assert [int(row["index"]) - 1 for row in csv.DictReader(stream)] == seen


@pytest.mark.parametrize(
    "wrong", [{"advance": "MOUSE"}, {"settle": -1}, {"seconds": float("nan")}, {"warm_up": float("inf")}]
)
def test_a_pace_that_makes_no_sense_is_refused(wrong: dict) -> None:
    with pytest.raises(DisplayError):
        Pace(**wrong)


def test_the_state_file_says_what_stands_on_the_display(tmp_path: Path) -> None:
    playback = Playback(PatchList(np.array([[0.2, 0.4, 1.0]]), ("sky",)), Pace(settle=1))
    expected = {"format": 1, "state": "drawing", "index": 1, "count": 1, "name": "sky", "codes": [0.2, 0.4, 1.0],
                "rgb_8bit": [51.0, 102.0, 255.0], "shown": None, "ready": None}  # fmt: skip
    assert playback.document(5.0) == expected
    playback.drawn(6.0)
    write_state(playback.document(7.0), tmp_path)
    found = json.loads((tmp_path / STATE_FILE).read_text(encoding="utf-8"))
    assert found == {**expected, "state": "ready", "shown": 6.0, "ready": 7.0}


def test_a_trigger_tells_every_touch_once(tmp_path: Path) -> None:
    path = tmp_path / "patch-next"
    trigger = Trigger(path)
    assert not trigger.touched()
    path.touch()
    assert [trigger.touched(), trigger.touched()] == [True, False]
    os.utime(path, (1, 1))
    assert [trigger.touched(), trigger.touched()] == [True, False]
    path.unlink()
    assert not trigger.touched()


def _readings(patches: PatchList) -> np.ndarray:
    """XYZ of an additive display with sRGB's curve, white Y = 100."""
    matrix = np.array([[41.24, 35.76, 18.05], [21.26, 71.52, 7.22], [1.93, 11.92, 95.05]])
    return np.asarray(srgb_decode(patches.codes) @ matrix.T)


def _rows(values: np.ndarray, *columns: list[object]) -> str:
    cells = [[f"{value:.9g}" for value in row] for row in values]
    return "".join(",".join([*row, *map(str, more)]) + "\n" for row, *more in zip(cells, *columns, strict=True))


def test_readings_in_order_become_measurements(tmp_path: Path) -> None:
    patches = published_patches()
    readings = _file(tmp_path, "X,Y,Z,380,390\n" + _rows(_readings(patches), ["7"] * 234, ["8"] * 234))
    paired = pair(_played(patches, tmp_path), readings)
    assert paired.matched_by == "order"
    assert paired.warnings == ()
    assert paired.header == ("R", "G", "B", "X", "Y", "Z", "380", "390")
    write_paired(paired, tmp_path / "measurements.csv")
    measured = read_measurements(tmp_path / "measurements.csv")
    np.testing.assert_allclose(measured.codes, patches.codes, atol=1e-9)
    np.testing.assert_allclose(measured.XYZ, _readings(patches), rtol=1e-8)


def test_readings_with_an_index_may_come_in_any_order_and_repeat(tmp_path: Path) -> None:
    order = [4, 3, 3, 0, 2]
    readings = _file(tmp_path, "X,Y,Z,index\n" + _rows(_readings(RGBWK)[order], [number + 1 for number in order]))
    paired = pair(_played(RGBWK, tmp_path), readings)
    assert paired.matched_by == "index"
    np.testing.assert_array_equal(np.array(paired.rows)[:, :3].astype(float), RGBWK.codes[order])
    assert paired.warnings == ("1 of the patches shown have no reading",)


@pytest.mark.parametrize("iso", [True, False])
def test_readings_with_a_time_find_the_patch_that_stood_then(tmp_path: Path, iso: bool) -> None:
    shown = _played(RGBWK, tmp_path)
    with shown.open(encoding="utf-8") as stream:
        ready = [row["ready"] for row in csv.DictReader(stream)]
    # Shown at 1e9, 1e9 + 2, ...: settled a second later, left a second after that.
    times = ready if iso else [1e9 + 2 * number + 1.5 for number in range(5)]
    readings = _file(tmp_path, "time,x,y,Y\n" + "".join(f"{time},0.3,0.3,1\n" for time in times[::-1]))
    paired = pair(shown, readings)
    assert paired.matched_by == "time"
    np.testing.assert_array_equal(np.array(paired.rows)[:, :3].astype(float), RGBWK.codes[::-1])


def test_patches_that_were_left_too_soon_do_not_count(tmp_path: Path) -> None:
    playback = Playback(RGBWK, Pace(settle=1))
    for now, stays in ((0, 2), (2, 0.9), (3, 2)):  # red, green too short, blue
        playback.drawn(now)
        playback.step(1, now + stays)
    playback.stop(5.5)  # white was never drawn
    paired = pair(write_shown(playback, tmp_path), _file(tmp_path, "X,Y,Z\n1,1,1\n2,2,2\n"))
    np.testing.assert_array_equal(np.array(paired.rows)[:, :3].astype(float), RGBWK.codes[[0, 2]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("X,Y,Z\n1,1,1\n", "1 readings, but 5 patches were shown"),
        ("X,Y\n1,1\n", "the header is X,Y"),
        ("X,Y,Z,index\n1,1,1,9\n", "line 2: patch 9 was not shown"),
        ("X,Y,Z,index\n1,1,1,one\n", "line 2: 'one' is no patch number"),
        ("X,Y,Z,time\n1,1,1,2001-09-09T01:46:40+00:00\n", "line 2: no patch stood settled at"),
        ("X,Y,Z,time\n1,1,1,noon\n", "line 2: 'noon' is no time"),
        ("X,Y,Z,time\n1,1,inf,5\n", "line 2: 'inf' is no finite number"),
    ],
)
def test_readings_that_belong_to_no_patch_are_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(DisplayError, match=message):
        pair(_played(RGBWK, tmp_path), _file(tmp_path, text))


def test_a_shown_list_without_what_is_needed_is_refused(tmp_path: Path) -> None:
    readings = _file(tmp_path, "X,Y,Z\n1,1,1\n", "readings.csv")
    with pytest.raises(DisplayError, match="lacks the column index"):
        pair(_file(tmp_path, "R,G,B\n1,1,1\n"), readings)
    with pytest.raises(DisplayError, match="no patch was shown long enough"):
        pair(_file(tmp_path, "R,G,B,index,name,shown,ready,gone\n1,1,1,1,,1,,2\n"), readings)


def test_commands_write_the_list_and_pair(run: Run, tmp_path: Path) -> None:
    code, out, _ = run("patches", "new", "-o", tmp_path / "patches.csv", "--json")
    assert code == 0
    assert json.loads(out) == {"file": str(tmp_path / "patches.csv"), "patches": 234}
    np.testing.assert_allclose(read_patches(tmp_path / "patches.csv").codes, published_patches().codes, atol=1e-9)
    _played(RGBWK, tmp_path)
    readings = _file(tmp_path, "X,Y,Z,index\n" + _rows(_readings(RGBWK)[:4], [1, 2, 3, 4]))
    code, out, err = run("patches", "pair", tmp_path / SHOWN_FILE, readings, "-o", tmp_path / "m.csv", "--json")
    assert code == 0
    assert json.loads(out)["readings"] == 4
    assert "1 of the patches shown have no reading" in err
    assert run("characterise", tmp_path / "m.csv")[0] == 0
    code, out, err = run("patches", "pair", tmp_path / "nowhere.csv", readings, "-o", tmp_path / "m.csv")
    assert (code, out) == (2, "")
    assert err.startswith("error: ")


def test_playing_needs_an_application(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("BLENDER", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    code, _, err = run("patches", "play", "-o", tmp_path)
    assert code == 2
    assert "set BLENDER to an application" in err
    assert json.loads((tmp_path / STATE_FILE).read_text(encoding="utf-8"))["state"] == "starting"
    code, _, err = run("patches", "play", "-o", _file(tmp_path, "no folder", "file") / "below")
    assert code == 2
    assert err.startswith("error: ")
    code, _, err = run("patches", "play", _file(tmp_path, "R,G,B\n1,1,x\n"), "-o", tmp_path)
    assert code == 2
    assert "line 2: 'x'" in err
