from vftcli.outputs.palette import COLOURS, SPARE, colours_of_names, rgb


def test_observers_keep_their_colours_whatever_runs_beside_them() -> None:
    assert colours_of_names(["gmo"])["gmo"] == COLOURS["gmo"]
    assert colours_of_names(["mine", "gmo"])["gmo"] == COLOURS["gmo"]


def test_others_get_colours_that_nobody_has() -> None:
    found = colours_of_names(["a", "fdo", "b", "gmo"])
    assert len(set(found.values())) == 4
    assert found["a"] not in COLOURS.values() or found["a"] not in (COLOURS["fdo"], COLOURS["gmo"])


def test_when_there_are_no_more_colours_they_come_again() -> None:
    names = [f"own {k}" for k in range(len(SPARE) + 1)]
    found = colours_of_names(names)
    assert len(set(found.values())) == len(SPARE)
    assert found[names[0]] == found[names[-1]]


def test_a_colour_in_numbers() -> None:
    assert rgb("#0c9fff") == (12, 159, 255)
    assert rgb("#9cf00a") == (156, 240, 10)
