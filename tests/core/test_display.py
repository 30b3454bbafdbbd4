from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spectral_core.display import builtin_profile_names, load_profile, read_profile, write_profile
from spectral_core.errors import DisplayError

rgb = st.lists(st.floats(-2, 2), min_size=3, max_size=3)


@pytest.mark.parametrize("name", builtin_profile_names())
@settings(deadline=None)  # the first example loads colour-science
@given(codes=rgb)
def test_inverse_undoes_forward_for_all_codes(name: str, codes: list[float]) -> None:
    """Outside 0..1 too: nothing is clipped. Near black the power amplifies rounding: compare in XYZ.

    The rounded constants of IEC 61966-2-1 leave a step of 3e-9 between sRGB's line and curve.
    """
    profile = load_profile(name)
    XYZ = profile.to_XYZ(np.array(codes))
    back = profile.to_codes(XYZ)
    assert np.isfinite(back).all()
    np.testing.assert_allclose(profile.to_XYZ(back), XYZ, atol=1e-8 if name == "sRGB" else 1e-12)


def test_htc_vive_2021_is_algorithm_1() -> None:
    profile = load_profile("htc-vive-2021")
    linear = profile.to_linear(np.array([0.5, 0.4, 0.3]))
    np.testing.assert_allclose(linear, [2.19 * 0.5 - 0.69 * 0.4 - 0.32 * 0.3, -0.87 * 0.5 + 1.80 * 0.4 + 0.02 * 0.3,
                                        0.04 * 0.5 - 0.086 * 0.4 + 0.88 * 0.3], atol=1e-12)  # fmt: skip
    white = profile.to_XYZ(np.ones(3))
    np.testing.assert_allclose(white[:2] / white.sum(), (0.3015, 0.3187), atol=5e-5)


def test_htc_vive_2020_sums_to_its_measured_white() -> None:
    profile = load_profile("htc-vive-2020")
    black = profile.to_XYZ(np.zeros(3))
    white = profile.to_XYZ(np.ones(3)) - black
    np.testing.assert_allclose(white[:2] / white.sum(), (0.299, 0.315), atol=1e-12)
    assert white[1] == pytest.approx(1.0)
    assert black[1] == pytest.approx(0.004)
    factors = [profile.to_XYZ(np.eye(3))[i, 1] - black[1] for i in range(3)] / np.array([0.303, 0.754, 0.078])
    np.testing.assert_allclose(factors, [0.905, 0.866, 0.934], atol=5e-4)


def test_profiles_survive_json(tmp_path: Path) -> None:
    path = tmp_path / "p.json"
    write_profile(load_profile("htc-vive-2020"), path)
    np.testing.assert_array_equal(
        read_profile(path).to_codes(np.eye(3)), load_profile("htc-vive-2020").to_codes(np.eye(3))
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gamma": [2.2, 2.2]}, "gamma"),
        ({"gamma": [2.2, 0, 2.2]}, "from 0.1 to 10"),
        ({"matrix": [[1, 0, 0], [1, 0, 0], [0, 0, 1]]}, "cannot be inverted"),
        ({"black_XYZ": ["dark", 0, 0]}, "no number"),
        ({"black_XYZ": [float("nan"), 0, 0]}, "finite"),
        ({"black_XYZ": [10**400, 0, 0]}, "no number"),
        ({"black_XYZ": [0, 1000, 0]}, "relative to white"),
        ({"gamma": [2.2, 1e-300, 2.2]}, "from 0.1 to 10"),
    ],
)
def test_damaged_profiles_are_refused(tmp_path: Path, change: dict[str, object], message: str) -> None:
    path = tmp_path / "p.json"
    write_profile(load_profile("htc-vive-2020"), path)
    document = json.loads(path.read_text())
    document["model"].update(change)
    path.write_text(json.dumps(document))
    with pytest.raises(DisplayError, match=message):
        read_profile(path)


def test_other_files_are_no_profiles(tmp_path: Path) -> None:
    for text in ("", "[1]", "1" * 5000, "{}", "{", '{"format": "spectral-booth display profile", "version": 1}'):
        path = tmp_path / "p.json"
        path.write_text(text)
        with pytest.raises(DisplayError):
            read_profile(path)
    with pytest.raises(DisplayError, match="no such file"):
        load_profile("nowhere.json")
