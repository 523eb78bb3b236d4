"""Shares of the work: loops and loops within them."""

from vftcli.signals.progress import enter, nobody, steps, watch


def test_nested_loops_share_the_part_of_the_loop_they_are_in() -> None:
    reported: list[float] = []
    watch(reported.append)
    try:
        enter(0.5, 1.0)
        for _ in steps("ab"):
            for _ in steps("xy"):
                pass
        assert reported == [0.5, 0.5, 0.5, 0.625, 0.75, 0.75, 0.875]
        enter(0.0, 1.0)
    finally:
        watch(nobody)


def test_a_loop_gives_its_items_whoever_watches() -> None:
    assert list(steps(range(3))) == [0, 1, 2]
    assert list(steps([])) == []
