"""docs/gallery.md shows every picture that its script takes, and no other."""

from gallery import EXHIBITS, LARGEST, PAGE, PICTURES, page

ALL = 1_500_000
"""Bytes of all pictures: the repository stays quick to fetch."""


def test_the_page_is_the_scripts() -> None:
    assert PAGE.read_text(encoding="utf-8") == page()


def test_every_picture_is_there_and_small() -> None:
    names = {f"{picture.name}.png" for exhibit in EXHIBITS for picture in exhibit.pictures}
    sizes = {path.name: path.stat().st_size for path in PICTURES.iterdir()}
    assert set(sizes) == names
    assert max(sizes.values()) <= LARGEST
    assert sum(sizes.values()) <= ALL
