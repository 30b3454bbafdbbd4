from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spectral_core import standards
from spectral_core.display import DisplayProfile, load_profile
from spectral_core.display.export import (
    XYZ_VIEW,
    OcioExport,
    blender_config,
    export_name,
    export_ocio,
    read_back_ocio,
    read_back_ocio_xyz,
)
from spectral_core.display.measuring.state import HeadsetState
from spectral_core.display.models.corrected import CorrectedLut
from spectral_core.errors import DisplayError, OutputError
from spectral_core.lights import Light

Run = Callable[..., tuple[int, str, str]]
_HEAD = """# A small config
ocio_profile_version: 2.1
search_path: "luts:filmic"
roles:
  default: Linear
  reference: XYZ E
  scene_linear: Linear
  cie_xyz_d65_interchange: XYZ D65
displays:
  sRGB:
    - !<View> {name: Standard, VIEW}
    - !<View> {name: Raw, colorspace: Non-Color}
active_displays: [sRGB]
active_views: [Standard, Raw]
"""
_SPACES = """colorspaces:
  - !<ColorSpace>
    name: XYZ E
  - !<ColorSpace>
    name: Non-Color
    isdata: true
  - !<ColorSpace>
    name: Linear
    aliases: [lin, Vive]
    from_scene_reference: !<GroupTransform>
      children:
        - !<FileTransform> {src: scale.spimtx}
        - !<MatrixTransform> {matrix: [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1]}
"""
_ENCODED = """  - !<ColorSpace>
    name: Encoded
    from_REFERENCE_reference: !<ExponentTransform> {value: 2.2, direction: inverse}
  - !<ColorSpace>
    name: XYZ D65
"""
# Blender's configs in small: up to 4.5 all spaces belong to the scene, from 5.0 displays have their own.
SCENE_CONFIG = (
    _HEAD.replace("VIEW", "colorspace: Encoded")
    + _SPACES
    + _ENCODED.replace("REFERENCE", "scene")
    + "    from_scene_reference: !<FileTransform> {src: scale.spimtx}\n"
)
DISPLAY_CONFIG = (
    _HEAD.replace("VIEW", "view_transform: Standard, display_colorspace: Encoded")
    + _SPACES
    + "display_colorspaces:\n"
    + _ENCODED.replace("REFERENCE", "display")
    + """default_view_transform: Standard
view_transforms:
  - !<ViewTransform>
    name: Standard
    from_scene_reference: !<FileTransform> {src: scale.spimtx}
"""
)


@pytest.fixture(params=[SCENE_CONFIG, DISPLAY_CONFIG], ids=["scene", "display"])
def base(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    return write_base(tmp_path, request.param)


def write_base(folder: Path, text: str = SCENE_CONFIG) -> Path:
    path = folder / "base" / "config.ocio"
    (path.parent / "luts").mkdir(parents=True)
    path.write_text(text)
    rows = "1.1 0 0 0\n0 1 0 0\n0 0 0.9 0\n"
    (path.parent / "luts" / "scale.spimtx").write_text(rows)
    return path


def test_ocio_gives_the_codes(profile: DisplayProfile, base: Path, tmp_path: Path) -> None:
    """Exact models: what 32-bit floats of XYZ leave, 2e-3 at channels of drive 0 and 0.003 dE00; the
    channels' interaction is resampled."""
    exported = export_ocio(profile, tmp_path / "out", base)
    read = read_back_ocio(profile, exported)
    assert read.by is not None, read.why
    assert read.max_code_error is not None
    assert read.max_dE00 is not None
    if isinstance(profile.model, CorrectedLut):
        assert read.max_code_error < 0.05
        assert read.max_dE00 < 0.5
    else:
        assert read.max_code_error < 2e-3
        assert read.max_dE00 < 0.003
    assert read.colours > 4000
    assert all(path.is_file() for path in exported.files)


@pytest.mark.parametrize("name", ["sRGB", "htc-vive-2021", "gain-offset-gamma", "channel-lut", "grey-lut-corrected"])
def test_ocio_away_from_black(
    name: str, fitted: dict[str, DisplayProfile], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From code 0.1 on 32-bit floats tell 1e-5; lines between a table's nodes 5e-5; the resampled table half
    a level of 8 bits."""
    profile = fitted[name] if name in fitted else load_profile(name)
    codes = np.random.default_rng(0).uniform(0.1, 1, (3000, 3))
    monkeypatch.setattr("spectral_core.display.export.read_back.probe_codes", lambda: codes)
    read = read_back_ocio(profile, export_ocio(profile, tmp_path / "out", write_base(tmp_path)))
    assert read.max_code_error is not None
    assert read.max_code_error < {"channel-lut": 5e-5, "grey-lut-corrected": 2e-3}.get(name, 2e-5)


def test_ocio_takes_pixels_that_are_xyz(profile: DisplayProfile, base: Path, tmp_path: Path) -> None:
    """As exact as the view of Rec.709 (see above); the plain display is sRGB's formula."""
    exported = export_ocio(profile, tmp_path / "out", base)
    for shown, display in ((profile, exported.display), (load_profile("sRGB"), "sRGB")):
        read = read_back_ocio_xyz(shown, replace(exported, display=display))
        assert read.by is not None, read.why
        assert read.max_code_error is not None
        assert read.max_dE00 is not None
        resampled = isinstance(shown.model, CorrectedLut)
        assert read.max_code_error < (0.05 if resampled else 2e-3)
        assert read.max_dE00 < (0.5 if resampled else 0.003)
        assert read.colours > 4000


def test_xyz_keeps_colours_outside_rec709(base: Path, tmp_path: Path) -> None:
    """Real surfaces under D65 that Blender's clamp of negative RGB changes; to 32-bit floats of the code, 2e-5."""
    D65 = Light.builtin("D65")
    names, chart_nm, chart = standards.colorchecker()
    samples_nm, samples = standards.fidelity_samples()
    assert samples.shape == (99, len(samples_nm))
    cyan = chart[names.index("cyan")] @ D65.weighting_factors(chart_nm).matrix
    green = samples[58 - 1] @ D65.weighting_factors(samples_nm).matrix
    XYZ = 0.6 * np.stack([cyan, green])
    assert (XYZ @ np.linalg.inv(standards.srgb_to_XYZ_matrix()).T).min(axis=1).max() < -0.01
    profile = load_profile("htc-vive-2021")
    codes = profile.to_codes(XYZ)
    assert ((codes > 0.1) & (codes < 1)).all()
    exported = export_ocio(profile, tmp_path / "out", base)
    np.testing.assert_allclose(displayed(XYZ, exported, XYZ_VIEW), codes, atol=2e-5)


def displayed(pixels: np.ndarray, exported: OcioExport, view: str) -> np.ndarray:
    """Codes (n, 3) that OpenColorIO gives to scene-linear pixels (n, 3)."""
    from spectral_core.imaging import oiio

    image = oiio().ImageBuf(oiio().ImageSpec(len(pixels), 1, 3, oiio().FLOAT))
    image.set_pixels(oiio().ROI(), np.float32(pixels[None]))
    shown = oiio().ImageBufAlgo.ociodisplay(
        image, exported.display, view, "scene_linear", colorconfig=str(exported.config)
    )
    assert not shown.has_error, shown.geterror()
    return np.asarray(shown.get_pixels(oiio().FLOAT)).reshape(-1, 3)


def test_both_displays_list_the_view_once(base: Path, tmp_path: Path) -> None:
    """However often is exported; `Standard` stays the first."""
    config = base
    for name in ("one", "two", "one", "Spectral XYZ", "Spectral XYZ"):
        exported = export_ocio(replace(load_profile("htc-vive-2020"), name=name), tmp_path / "out", config)
        config = exported.config
    text = config.read_text()
    assert f"active_views: [Standard, Raw, {XYZ_VIEW}]" in text
    assert 'active_displays: [sRGB, "two", "one", "Spectral XYZ (profile)"]' in text
    for display in ("sRGB", "one", "two", "Spectral XYZ (profile)"):
        assert text.count(f'{{name: {XYZ_VIEW}, colorspace: "{XYZ_VIEW}: {display}"}}') == 1
        assert text.count(f'name: "{XYZ_VIEW}: {display}"') == 1
    block = text[text.index("  sRGB:") : text.index("active_displays")]
    assert block.index(XYZ_VIEW) < block.index('"two":')  # in sRGB's own list


def test_a_config_that_lists_no_views_shows_all(tmp_path: Path) -> None:
    base = write_base(tmp_path, SCENE_CONFIG.replace("active_views: [Standard, Raw]\n", ""))
    profile = load_profile("htc-vive-2020")
    exported = export_ocio(profile, tmp_path / "out", base)
    assert "active_views" not in exported.config.read_text()
    assert read_back_ocio_xyz(profile, exported).by is not None


def test_ocio_keeps_what_the_config_had(base: Path, tmp_path: Path) -> None:
    exported = export_ocio(load_profile("htc-vive-2020"), tmp_path / "out", base)
    made = exported.config.read_text().splitlines()
    for line in base.read_text().splitlines():
        assert line in made or line.startswith(("active_displays", "active_views"))
    assert 'active_displays: [sRGB, "htc-vive-2020"]' in made
    assert f"active_views: [Standard, Raw, {XYZ_VIEW}]" in made
    assert (exported.display, exported.view, exported.xyz_view) == ("htc-vive-2020", "Standard", XYZ_VIEW)
    assert (tmp_path / "out/luts/scale.spimtx").read_text() == (base.parent / "luts/scale.spimtx").read_text()


def test_ocio_clips(tmp_path: Path) -> None:
    """Below 0, above 1 and far beyond: in the range, channel by channel."""
    profile = load_profile("htc-vive-2021")
    exported = export_ocio(profile, tmp_path / "out", write_base(tmp_path))
    XYZ = np.array([[-1.0, 0.5, 2.0], [0.0, 1.0, 0.0], [1e4, 1e4, 1e4], [0.5, 0.5, -0.2]])
    # Twice the XYZ of D65's scale is the config's scene-linear.
    for view, pixels in ((exported.view, 2 * XYZ), (exported.xyz_view, XYZ)):
        np.testing.assert_allclose(displayed(pixels, exported, view), np.clip(profile.to_codes(XYZ), 0, 1), atol=1e-5)


def test_both_eyes_in_one_config(tmp_path: Path, fitted: dict[str, DisplayProfile]) -> None:
    eyes = {"left": "channel-lut", "right": "grey-lut-corrected"}
    left, right = (replace(fitted[kind], name="headset", state=HeadsetState(eye=eye)) for eye, kind in eyes.items())
    first = export_ocio(left, tmp_path / "out", write_base(tmp_path))
    second = export_ocio(right, tmp_path / "out", first.config)
    assert (first.display, second.display) == ("headset left", "headset right")
    errors = [read_back_ocio(*pair).max_dE00 for pair in ((left, first), (right, second))]
    assert errors[0] is not None
    assert errors[0] < 0.003
    assert errors[1] is not None
    assert errors[1] < 0.5


def test_a_new_profile_of_the_same_name_replaces_the_old(tmp_path: Path, fitted: dict[str, DisplayProfile]) -> None:
    """OpenColorIO never reads a file twice: the new table has a new name, the old one goes."""
    base = write_base(tmp_path)
    for name, config in (("grey-lut-corrected", base), ("channel-lut", tmp_path / "out/config.ocio")):
        profile = replace(fitted[name], name="headset")
        exported = export_ocio(profile, tmp_path / "out", config)
        read = read_back_ocio(profile, exported)
        assert read.max_dE00 is not None
        assert read.max_dE00 < 0.5
        assert {path for path in (tmp_path / "out").rglob("*") if path.is_file()} == set(exported.files)
    assert len(list((tmp_path / "out/luts").iterdir())) == 2


def test_exporting_again_replaces_the_display(tmp_path: Path, fitted: dict[str, DisplayProfile]) -> None:
    """Also onto a config that has it, and beside another; a name that Blender has stays told apart."""
    others = [replace(load_profile("htc-vive-2020"), name=name) for name in ("sRGB", "other", "last")]
    config = write_base(tmp_path)
    for each in others:
        config = export_ocio(each, tmp_path / "out", config).config
    once = config.read_text()
    assert 'active_displays: [sRGB, "sRGB (profile)", "other", "last"]' in once
    for each in others:
        again = export_ocio(each, tmp_path / "out", config)
        read = read_back_ocio(each, again)
        assert read.max_dE00 is not None, read.why
        assert read.max_dE00 < 0.003
    assert config.read_text() == once


def test_taken_names_are_left_to_blender(base: Path, tmp_path: Path) -> None:
    for taken in ("sRGB", "vive", "XYZ d65", "scene_linear"):
        profile = replace(load_profile("htc-vive-2020"), name=taken)
        assert export_ocio(profile, tmp_path / "out", base).display == f"{taken} (profile)"


@pytest.mark.parametrize(
    ("name", "expected"),
    [("My headset, left: 80 %", "My headset_ left_ 80"), ("../../etc", "etc"), ("  ", "display"), ("ü\n{}", "display")],
)
def test_names_fit_files_and_configs(name: str, expected: str) -> None:
    assert export_name(replace(load_profile("sRGB"), name=name)) == expected


def test_foreign_folders_stay_as_they_are(tmp_path: Path) -> None:
    base, folder = write_base(tmp_path), tmp_path / "mine"
    folder.mkdir()
    (folder / "config.ocio").write_text(SCENE_CONFIG)
    for target in (folder, base.parent):
        with pytest.raises(OutputError, match="not from here"):
            export_ocio(load_profile("sRGB"), target, base)
    assert (folder / "config.ocio").read_text() == SCENE_CONFIG
    assert [path.name for path in folder.iterdir()] == ["config.ocio"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("  reference: XYZ E\n", ""), "no role 'reference'"),
        (("search_path", "no_path"), "search_path"),
        (('"luts:filmic"', '"/etc:luts"'), "search_path"),
        (("colorspaces:\n", "spaces:\n"), "no section 'colorspaces'"),
        (("active_displays: [sRGB]\n", ""), "active_displays"),
        (("  scene_linear: Linear\n", ""), "no role 'scene_linear'"),
        (("  sRGB:\n", "  Monitor:\n"), "no display 'sRGB'"),
        (("active_views: [Standard, Raw]", "active_views:\n  - Standard"), "active_views"),
    ],
)
def test_other_configs_are_refused(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    base = write_base(tmp_path, SCENE_CONFIG.replace(*change))
    with pytest.raises(DisplayError, match=message):
        export_ocio(load_profile("sRGB"), tmp_path / "out", base)
    assert not (tmp_path / "out").exists()


def test_the_config_of_the_blender_at_hand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OCIO", raising=False)
    with pytest.raises(DisplayError, match="--base"):  # bpy is blocked here
        blender_config()
    base = write_base(tmp_path)
    monkeypatch.setenv("OCIO", str(base))
    assert blender_config() == base


def test_command(run: Run, tmp_path: Path) -> None:
    base, out = write_base(tmp_path), tmp_path / "out"
    code, text, _ = run("profile", "export", "htc-vive-2020", "--ocio", out, "--base", base, "--json")
    document = json.loads(text)
    assert code == 0
    assert document["files"][0] == str(out / "config.ocio")
    assert document["max_code_error"] < 2e-3
    assert document["max_code_error_8bit"] == pytest.approx(255 * document["max_code_error"])
    assert document["read_back_by"].startswith("OpenColorIO")
    assert (document["display"], document["view"], document["warnings"]) == ("htc-vive-2020", "Standard", [])
    assert document["xyz_view"] == XYZ_VIEW
    assert document["xyz_max_code_error"] < 2e-3
    assert document["xyz_max_dE00"] < 0.003
    for option, name in (("--cube", "a.cube"), ("--icc", "a.icc")):
        code, text, _ = run("profile", "export", "htc-vive-2020", option, tmp_path / name, "--json")
        assert code == 0
        assert json.loads(text)["files"] == [str(tmp_path / name)]
        assert (tmp_path / name).is_file()


def test_what_could_not_be_read_back_is_said(run: Run, tmp_path: Path) -> None:
    base = write_base(tmp_path, SCENE_CONFIG.replace("version: 2.1", "version: 2.99"))
    code, text, err = run("profile", "export", "sRGB", "--ocio", tmp_path / "out", "--base", base, "--json")
    document = json.loads(text)
    assert code == 0
    assert document["max_code_error"] is None
    assert document["read_back_by"] is None
    assert err.startswith("warning: not read back: OpenImageIO")


@pytest.mark.parametrize("arguments", [(), ("--ocio", "a", "--icc", "b"), ("--ocio", "a", "--base", "nowhere.ocio")])
def test_bad_commands(run: Run, arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = run("profile", "export", "sRGB", *arguments)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert len(err.splitlines()) == 1
    assert not list(tmp_path.iterdir())
