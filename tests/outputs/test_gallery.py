"""docs/pictures holds what its script takes; every picture is shown on a page, and is small."""

from gallery import EXHIBITS, LARGEST, PICTURES, ROOT


def test_every_picture_is_taken_shown_and_small() -> None:
    names = {f"{picture.name}.png" for exhibit in EXHIBITS for picture in exhibit.pictures}
    sizes = {path.name: path.stat().st_size for path in PICTURES.iterdir()}
    assert set(sizes) == names
    assert max(sizes.values()) <= LARGEST
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    text = "".join(page.read_text("utf-8") for page in pages)
    assert not [name for name in names if f"pictures/{name})" not in text]
