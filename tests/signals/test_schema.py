"""What is a value of each kind of TOML, and the one complaint about what is not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vftcli.signals.errors import ParameterError
from vftcli.signals.schema import NUMBER, PER_JOINT, SWITCH, TEXT, WHOLE, set_value, spread, vector

FLOATS = st.floats(allow_nan=False, allow_infinity=False)
VALUES = st.one_of(
    st.booleans(), st.integers(), st.floats(), st.text(), st.lists(FLOATS, max_size=3)
)


@given(value=VALUES)
def test_a_plain_value_is_of_its_own_kind_alone(value: object) -> None:
    """Of these kinds only whole numbers are of two, and true is no number."""
    kinds = {NUMBER: (int, float), WHOLE: (int,), SWITCH: (bool,), TEXT: (str,)}
    for kind, types in kinds.items():
        fits = type(value) in types and (not isinstance(value, float) or bool(np.isfinite(value)))
        assert (kind.broken("key", value) == "") == fits


@given(numbers=st.lists(FLOATS, min_size=1, max_size=4), count=st.integers(1, 4))
def test_a_list_is_spread_where_it_has_one_or_one_for_each(
    numbers: list[float], count: int
) -> None:
    assert PER_JOINT.broken("key", numbers) == ""
    assert (vector(count).broken("key", numbers) == "") == (len(numbers) == count)
    text = ",".join(map(repr, numbers))
    assert spread(set_value(text, text), len(numbers), "joints", "key").tolist() == numbers
    if len(numbers) not in {1, count}:
        with pytest.raises(ParameterError, match=f"give one, or one for each of {count} joints"):
            spread(numbers, count, "joints", "key")


def test_an_integer_beyond_every_float_is_no_number() -> None:
    assert NUMBER.broken("mass", 10**400).endswith("it must be a finite number")
    assert PER_JOINT.broken("gain", []) == "gain is []; it must be a number or one a joint"
