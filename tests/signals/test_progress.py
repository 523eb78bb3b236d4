"""Shares of the work: loops and loops within them."""

from vftcli.signals.progress import heard_by, passed, stage, steps


def test_nested_loops_share_the_part_of_the_loop_they_are_in() -> None:
    reported: list[tuple[str, float]] = []
    with heard_by(lambda *words: reported.append(words)):
        stage("second half", 0.5, 1.0)
        for _ in steps("ab"):
            for _ in steps("xy"):
                pass
        shares = [0.5, 0.5, 0.5, 0.625, 0.75, 0.75, 0.875]
        names = ["second half", *[""] * 6]
        assert reported == list(zip(names, shares, strict=True))
        stage("all")
    assert list(steps(range(3))) == [0, 1, 2]  # whoever hears
    assert list(steps([])) == []


def test_a_share_of_a_part_is_reported_within_it() -> None:
    heard: list[tuple[str, float]] = []
    with heard_by(lambda name, share: heard.append((name, share))):
        stage("listing", 0.2, 0.6)
        passed(0.5)
    assert heard == [("listing", 0.2), ("", 0.4)]
