"""An optional package: found without loading it, asked for by name, missed in one line."""

import sys

import pytest

from vftcli.signals.errors import LogError, PackageError
from vftcli.signals.packages import PACKAGES, check_installed, installed, needed


@pytest.mark.parametrize("module", PACKAGES)
def test_a_missing_package_is_named_with_use_and_remedy(module, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    assert not installed(module)
    package, install = PACKAGES[module]
    line = f"a thing needs {package}, which is not installed here: {install}"
    with pytest.raises(PackageError) as caught:
        check_installed(module, "a thing")
    assert str(caught.value) == line
    with pytest.raises(LogError) as caught:
        needed(module, "a thing", "; or leave it", LogError)
    assert str(caught.value) == f"{line}; or leave it"


def test_a_package_that_lacks_another_is_not_called_missing(monkeypatch):
    place, words = "vftcli.signals.packages.import_module", r"\(No module named 'no_such_module'"
    monkeypatch.setattr(place, lambda _: __import__("no_such_module"))
    with pytest.raises(PackageError, match=f"cannot be loaded {words}"):
        needed("rerun", "a thing")
