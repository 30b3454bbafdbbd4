"""A texture that is another one, read otherwise."""

from __future__ import annotations

from spectral_core.arrays import BoolArray, Float64Array
from spectral_core.textures.base import HyperspectralTexture, Samples


class DerivedTexture(HyperspectralTexture):
    """Another texture's samples; whoever derives from it changes what they mean."""

    def __init__(self, texture: HyperspectralTexture) -> None:
        self._texture = texture
        for name in (
            "name", "format", "height", "width", "wavelengths_nm", "kind", "scale", "ignore_value", "fluorescent",
            "concurrent", "files", "part", "warnings",
        ):  # fmt: skip
            setattr(self, name, getattr(texture, name))

    def samples(self, first: int, count: int) -> Samples:
        """`count` rows from `first` on as they are stored: (count, width, bands)."""
        return self._texture.samples(first, count)

    def close(self) -> None:
        """As the texture."""
        self._texture.close()

    def rows_per_tile(self) -> int:
        """As many as the texture's own format reads well."""
        return self._texture.rows_per_tile()

    @property
    def gain(self) -> Float64Array:
        """As the texture's."""
        return self._texture.gain

    @property
    def dark(self) -> Float64Array:
        """As the texture's."""
        return self._texture.dark

    @property
    def good(self) -> BoolArray:
        """As the texture's."""
        return self._texture.good
